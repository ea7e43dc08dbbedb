"""Figures of runs, and of trade-off curves and surfaces, as PNG."""

from obsdesign.families.guarantee import Guarantee
from obsdesign.plot import run as continuous
from obsdesign.plot.front import front_figure
from obsdesign.plot.hybrid import hybrid_figure
from obsdesign.plot.surface import surface_figure
from obsdesign.plot.tradeoff import curves_figure, tradeoff_figure
from obsdesign.simulate import HybridRun, Run
from obsdesign.spec import Spec

__all__ = ["curves_figure", "front_figure", "run_figure", "surface_figure", "tradeoff_figure"]


def run_figure(spec: Spec, run: Run | HybridRun, guarantee: Guarantee | None) -> bytes:
    """Draw a run of an observer; see `run.run_figure`, `hybrid.hybrid_figure`."""
    if isinstance(run, HybridRun):
        return hybrid_figure(spec, run, guarantee)
    return continuous.run_figure(spec, run, guarantee)
