"""Which inequalities answer for an injection and a relaxation of a request."""

from dataclasses import dataclass

from obsdesign.design.sporadic.landscape import Form
from obsdesign.errors import UsageError
from obsdesign.observers.request import SporadicRequest
from obsdesign.observers.sporadic import Sporadic
from obsdesign.observers.sporadic_relaxations import Predictor, Proposition2, Reduced
from obsdesign.observers.sporadic_slack import Held, Proposition3, Proposition4, Proposition5


@dataclass(frozen=True)
class Scheme:
    """One curve: the limit, by inequalities without the gains where there are such, and the gains."""

    injection: str
    relaxation: str
    limit: Form
    gains: Form
    printed: Form  # what Table I counts

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
TIGHTEST = {"dynamic": "proposition-2", "predictor": "proposition-2", "hold": "proposition-5"}
WIDER = {"dynamic": ("dynamic", "hold"), "predictor": ("predictor",), "hold": ("hold",)}  # H = 0 is one of any H


def schemes(request: SporadicRequest) -> tuple[Scheme, ...]:
    """Schemes of a request, in its order, each once.

    Raises
    ------
    UsageError
        A relaxation fits none of the injections, or an injection none of the relaxations.
    """
    chosen: list[Scheme] = []
    for injection in request.injections:
        wanted = request.relaxations or (TIGHTEST[injection],)
        fitting = [s for name in wanted for s in SCHEMES if s.relaxation == name and s.injection in WIDER[injection]]
        if not fitting:
            needed = TIGHTEST[injection]
            raise UsageError(f"observer.relaxation: {', '.join(wanted)} is not for injection {injection}; use {needed}")
        chosen += [scheme for scheme in fitting if scheme not in chosen]
    unused = [name for name in request.relaxations if name not in {s.relaxation for s in chosen}]
    if unused:
        raise UsageError(f"observer.relaxation: {unused[0]} is not for injection {', '.join(request.injections)}")
    return tuple(chosen)
