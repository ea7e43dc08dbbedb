"""Which inequalities answer for an injection and a relaxation of a request."""

from dataclasses import dataclass

from obsdesign.dissipation.bounds import require_agreement
from obsdesign.families.sporadic.landscape import Form
from obsdesign.families.sporadic.relaxations import Predictor, Proposition2, Reduced
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.families.sporadic.slack import Held, Proposition3, Proposition4, Proposition5
from obsdesign.families.sporadic.theorem import Sporadic


@dataclass(frozen=True)
class Scheme:
    """One curve: the limit, by inequalities without the gains where there are such, and the gains."""

    injection: str
    relaxation: str
    limit: Form
    gains: Form
    printed: Form  # what Table I counts

    @property
    def names(self) -> dict[str, str]:
        """What tells it from other curves."""
        return {"injection": self.injection, "relaxation": self.relaxation}

    def counts(self, family: Sporadic) -> dict[str, int]:
        """Scalar unknowns of the printed inequalities, and of those that the limit takes."""
        return {"printed": self.printed(family).scalars, "solved": self.limit(family).scalars}


SCHEMES = (
    Scheme("dynamic", "proposition-2", Reduced, Proposition2, Proposition2),
    Scheme("dynamic", "proposition-3", Proposition3, Proposition3, Proposition3),
    Scheme("dynamic", "proposition-4", Proposition4, Proposition4, Proposition4),
    Scheme("predictor", "proposition-2", Predictor, Predictor, Predictor),
    Scheme("hold", "proposition-5", Held, Held, Proposition5),
)


def schemes(request: SporadicRequest) -> tuple[Scheme, ...]:
    """Schemes of a request, in its order, each once.

    Raises `UsageError`: a relaxation fits none of the injections, or an injection none of the relaxations.
    """
    require_agreement(request)
    return tuple(s for pair in request.pairs for s in SCHEMES if (s.injection, s.relaxation) == pair)
