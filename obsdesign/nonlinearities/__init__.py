"""The catalogue of nonlinearities: one file a type, with its data, its multiplier and its words.

To add one: a file with a `Template`, a line in TEMPLATES, and a spec that uses it.
"""

from obsdesign.model.multiplier import Multiplier, combine
from obsdesign.nonlinearities.ball import BALL
from obsdesign.nonlinearities.cocoercive import COCOERCIVE
from obsdesign.nonlinearities.cone import CONE
from obsdesign.nonlinearities.jacobian import JACOBIAN
from obsdesign.nonlinearities.library import FUNCTIONS
from obsdesign.nonlinearities.lipschitz import LIPSCHITZ
from obsdesign.nonlinearities.monotone import MONOTONE
from obsdesign.nonlinearities.one_sided_lipschitz import ONE_SIDED_LIPSCHITZ
from obsdesign.nonlinearities.sector import SECTOR
from obsdesign.nonlinearities.slope import SLOPE
from obsdesign.nonlinearities.template import Template
from obsdesign.nonlinearities.user import USER

TEMPLATES: dict[str, Template] = {
    "monotone": MONOTONE,
    "lipschitz": LIPSCHITZ,
    "slope": SLOPE,
    "sector": SECTOR,
    "cocoercive": COCOERCIVE,
    "ball": BALL,
    "one-sided-lipschitz": ONE_SIDED_LIPSCHITZ,
    "jacobian": JACOBIAN,
    "cone": CONE,
    "multiplier": USER,
    **FUNCTIONS,
}

__all__ = ["FUNCTIONS", "TEMPLATES", "Multiplier", "Template", "combine"]
