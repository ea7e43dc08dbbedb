"""From a request for an observer with the gains L1 and L2 (families l2, linf) to certified gains."""

from obsdesign.design.engine import Engine
from obsdesign.design.incremental.designer import Design, Designer
from obsdesign.spec.model import Spec

__all__ = ["Design", "design_incremental"]


def design_incremental(spec: Spec, engine: Engine) -> Design:
    """Design, or analyze, an observer with the gains L1 and L2.

    Raises
    ------
    UsageError
        The limit of gamma is zero and nothing bounds the gain; the multiplier does not allow a free L2.
    UndecidedError
        The solver found neither a solution nor that there is none.
    """
    return Designer(spec, engine).outcome()
