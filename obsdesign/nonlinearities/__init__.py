"""The catalogue of nonlinearities: one file a multiplier set.

To add one: a file with a function (data, nq, nf) -> Multiplier, a line in TEMPLATES, and a spec that uses it.
"""

from collections.abc import Callable
from typing import Any

from obsdesign.model.multiplier import Multiplier, combine
from obsdesign.nonlinearities.ball import ball
from obsdesign.nonlinearities.cocoercive import cocoercive
from obsdesign.nonlinearities.cone import cone
from obsdesign.nonlinearities.jacobian import jacobian
from obsdesign.nonlinearities.library import FUNCTIONS
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.nonlinearities.monotone import monotone
from obsdesign.nonlinearities.one_sided_lipschitz import one_sided_lipschitz
from obsdesign.nonlinearities.sector import sector
from obsdesign.nonlinearities.slope import slope
from obsdesign.nonlinearities.user import user

Template = Callable[[Any, int, int], Multiplier]

TEMPLATES: dict[str, Template] = {
    "monotone": monotone,
    "lipschitz": lipschitz,
    "slope": slope,
    "sector": sector,
    "cocoercive": cocoercive,
    "ball": ball,
    "one-sided-lipschitz": one_sided_lipschitz,
    "jacobian": jacobian,
    "cone": cone,
    "multiplier": user,
    **{name: function.template for name, function in FUNCTIONS.items()},
}

__all__ = ["FUNCTIONS", "TEMPLATES", "Multiplier", "Template", "combine"]
