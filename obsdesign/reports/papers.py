"""Figures and tables of the papers that the shipped specs make again: `reproduces` in a spec names an item of these.

A paper is recognised by what its citation in `source` must hold.
"""

from collections.abc import Mapping

from obsdesign.records import dataclass

DRAWING = "drawing"  # of an item in which nothing is computed


@dataclass(frozen=True)
class Paper:
    """A paper: its name in a list, what a citation of it holds, and its items with what they show."""

    name: str
    title: str
    words: tuple[str, ...]
    items: Mapping[str, str]

    def cited(self, source: str) -> bool:
        """Whether a citation is one of this paper."""
        return all(word in source for word in self.words)


PAPERS = (
    Paper(
        "Corless and Chakrabarty (2019)",
        "L2 observers for a class of nonlinear systems with unknown inputs",
        ("Corless", "Chakrabarty", "(2019)"),
        {
            "Section 6": "gain from the derivative of the unknown inputs, for the gains of the example",
            "Fig. 1": "errors of states and unknown inputs of (60), unknown inputs and their estimates",
        },
    ),
    Paper(
        "Chakrabarty, Corless, Buzzard, Żak and Rundell (2016)",
        "Sufficient conditions for exogenous input estimation in nonlinear systems",
        ("Corless", "Buzzard", "(2016)"),
        {
            "Section VI": "numbers of the example (47)",
            "Fig. 1": "errors of states and of the unknown input of (47), the input and its reconstruction",
        },
    ),
    Paper(
        "Abbaszadeh and Marquez (2010)",
        "Robust H-infinity filtering for Lipschitz nonlinear systems via multiobjective optimization",
        ("Abbaszadeh", "Marquez", "(2010)"),
        {
            "Example 1": "largest constant of a second-order system",
            "Example 2": "constants and gain of a flexible joint, in two coordinates",
            "Fig. 1": "true and estimated states of Example 2",
            "Example 3": "constant, gain and attenuation of a polynomial system",
            "Fig. 2": "true and estimated states of Example 3",
            "Fig. 3": "trade-off over the weight at one decay rate",
            "Fig. 4": "surface of the largest constant over weight and decay rate",
            "Fig. 5": "surface of the least gain over weight and decay rate",
        },
    ),
    Paper(
        "Yi, Ortega and Zhang (2018)",
        "On state observers for nonlinear systems: a new design and a unifying framework",
        ("Yi", "Ortega", "(2018)"),
        {
            "Fig. 1": DRAWING,
            "Table I": "six observers of the Cuk converter",
            "Fig. 2": "states of the converter and errors of its observers, with noise",
        },
    ),
    Paper(
        "Ferrante, Gouaisbaut, Sanfelice and Tarbouriech (2019)",
        "L2 State Estimation with Guaranteed Convergence Speed in the Presence of Sporadic Measurements",
        ("Ferrante", "Tarbouriech", "(2019)"),
        {
            "Table I": "number of scalar unknowns of each proposition",
            "Fig. 1": "the same over the order of the plant, for one output",
            "Example 1": "gain that the gains of an oscillator achieve",
            "Fig. 2": "Example 1: gain against the longest interval, four relaxations",
            "Fig. 3": "Example 1: errors with a disturbance, two gains",
            "Fig. 4": "Example 1: errors without a disturbance, two gains",
            "Example 2": "gain of a robot with sample and hold",
            "Fig. 5": "Example 2: gain against jitter",
            "Fig. 6": "Example 2: distance to the set where the estimate is right, two gains",
            "Fig. 7": "Example 2: errors with a disturbance, two gains",
            "Fig. 8": "Example 3: gain against the longest interval, four relaxations",
            "Table II": "Example 3: number of scalar unknowns, and time",
            "Fig. 9": "Example 3: errors with a disturbance, three designs",
            "Example 3": "longest interval that a predictor from the literature tolerates",
        },
    ),
)


def paper_of(source: str) -> Paper | None:
    """Paper that a citation names."""
    return next((paper for paper in PAPERS if paper.cited(source)), None)
