"""The catalogue of nonlinearities: one file a multiplier set.

To add one: a file with a function (data, nq, nf) -> Multiplier, a line in TEMPLATES, and a spec that uses it.
"""

from collections.abc import Callable
from typing import Any

from obsdesign.model.multiplier import Multiplier, combine
from obsdesign.nonlinearities.library import FUNCTIONS
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.nonlinearities.monotone import monotone
from obsdesign.nonlinearities.slope import slope
from obsdesign.nonlinearities.user import user

Template = Callable[[Any, int, int], Multiplier]

TEMPLATES: dict[str, Template] = {
    "monotone": monotone,
    "lipschitz": lipschitz,
    "slope": slope,
    "multiplier": user,
    **{name: function.template for name, function in FUNCTIONS.items()},
}

__all__ = ["FUNCTIONS", "TEMPLATES", "Multiplier", "Template", "combine"]
