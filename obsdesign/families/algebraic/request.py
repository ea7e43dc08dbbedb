"""What a spec asks of an observer without an LMI: its sections, and the same in expressions of the plant's signals."""

from collections.abc import Collection, Mapping, Sequence
from typing import Literal

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.families import asked
from obsdesign.families.algebraic.forms import (
    ANY,
    Coordinate,
    Estimator,
    HighGain,
    Immersion,
    Regression,
    Request,
    Sought,
    Transformed,
)
from obsdesign.families.algebraic.keys import (
    CoordinatesSection,
    EstimatorSection,
    HighGainSection,
    ImmersionSection,
)
from obsdesign.model.equations import Typed
from obsdesign.sections.document import Loc
from obsdesign.sections.scalars import described
from obsdesign.sections.values import Reader, meaning
from obsdesign.sections.words import unknown
from obsdesign.spec import Spec

MOST_DEGREE = 12
EPSILON = fmpq(1, 10**10)  # of DREM, against the square of the determinant


class Texts:
    """Reads the expressions of a section, over the signals of the plant."""

    def __init__(self, reader: Reader, typed: Typed) -> None:
        self.reader, plant = reader, typed.equations
        self.states, self.outputs, self.inputs = plant.states, tuple(plant.outputs), plant.inputs
        self.taken = set(plant.signals)

    @property
    def known(self) -> tuple[str, ...]:
        """What an observer knows: t, outputs, inputs."""
        return ("t", *self.outputs, *self.inputs)

    def one(self, text: str, loc: Loc, names: Sequence[str]) -> Expression:
        """An expression of these names."""
        return self.reader.expression(text, loc, names)

    def by_name(
        self, texts: Mapping[str, str], loc: Loc, kind: str, allowed: Sequence[str], names: Sequence[str]
    ) -> dict[str, Expression]:
        """Expressions by names that must be among the allowed ones."""
        found = {}
        for name, text in texts.items():
            if name in allowed:
                found[name] = self.one(text, (*loc, name), names)
            else:
                self.reader.wrong((*loc, name), unknown(kind, name, allowed, {}), at_key=True, id="OBS203")
        return found

    def new(self, name: str, loc: Loc) -> str:
        """Name of a signal of the observer, which no other signal may have."""
        reason = meaning(name) or ("is a signal already; choose another name" if name in self.taken else None)
        if reason:
            self.reader.wrong(loc, f"{described(name)} {reason}", id="OBS211")
        self.taken.add(name)
        return name

    def unmeasured(self, typed: Typed) -> tuple[str, ...]:
        """States that no output shows by itself."""
        shown = {side.text for side in typed.undisturbed.outputs.values()}
        return tuple(name for name in self.states if name not in shown)

    def complete(self, given: Mapping[str, Expression], typed: Typed, loc: Loc) -> None:
        """Refuse a left inverse that leaves states out; of one with wrong names that is not told too."""
        missing = [name for name in self.unmeasured(typed) if name not in given]
        if missing and self.reader.clean(loc):
            said = f"gives no {', '.join(missing)}, which no output shows; add an expression for each"
            self.reader.wrong(loc, said, id="OBS504")


def request(reader: Reader, section: asked.ObserverSection, problem: asked.Estimation) -> Request:
    """Return the request, its expressions read."""
    typed = problem.typed
    if problem.generator is not None and problem.generator.Am.size:
        said = f"type {section.type} estimates no disturbance; leave it out, or add its states to system.dynamics"
        reader.wrong(("disturbance",), said, id="OBS406")
    if typed is None:
        return Request(section.type, None)
    texts = Texts(reader, typed)
    if isinstance(section, CoordinatesSection):
        return Request(section.type, read_coordinates(texts, section, typed))
    if isinstance(section, ImmersionSection):
        return Request(section.type, read_immersion(texts, section, typed))
    assert isinstance(section, HighGainSection)
    return Request(section.type, read_high_gain(texts, section, typed))


def read_coordinates(texts: Texts, section: CoordinatesSection, typed: Typed) -> Transformed | Sought:
    """Coordinates, left inverse and estimator."""
    reader = texts.reader
    found: list[Coordinate] = []
    if isinstance(section.coordinates, str):
        return read_sought(texts, section)
    for name in ("degree", "lambdas", "functions"):
        if getattr(section, name) is not None:
            reader.wrong(("observer", name), "goes with coordinates: find; leave it out", at_key=True, id="OBS213")
    for i, each in enumerate(section.coordinates):
        loc: Loc = ("observer", "coordinates", i)
        earlier = tuple(one.name for one in found)
        phi = texts.one(each.phi, (*loc, "phi"), texts.states)
        rate = texts.one(each.rate, (*loc, "lambda"), (*texts.outputs, *texts.inputs))
        B = texts.one(each.B, (*loc, "B"), (*texts.known, *earlier))
        found.append(Coordinate(texts.new(each.name, (*loc, "name")), phi, rate, B))
    if reader.clean(("observer", "coordinates")):
        require_kind(reader, section.type, found)
    names = tuple(one.name for one in found)
    loc = ("observer", "left_inverse")
    inverse = texts.by_name(section.left_inverse, loc, "state", texts.states, (*names, *texts.known))
    texts.complete(inverse, typed, loc)
    estimated = tuple(one.name for one in found if one.estimated)
    clear = reader.clean(("observer", "coordinates"))  # otherwise a lambda may be a stand-in
    estimator = None
    if section.estimator is not None:
        estimator = read_estimator(texts, section.estimator, names, estimated if clear else names)
        if not estimated and clear:
            said = "estimates the constants of coordinates with lambda 0, and there are none; leave it out"
            reader.wrong(("observer", "estimator"), said, at_key=True, id="OBS213")
    elif estimated and clear:
        said = f"is required: the constant of {', '.join(estimated)}, with lambda 0, must be estimated"
        reader.wrong(("observer", "estimator"), said, id="OBS205")
    return Transformed(tuple(found), inverse, estimator, section.recast is not None)


def read_sought(texts: Texts, section: CoordinatesSection) -> Sought:
    """What is searched for."""
    reader = texts.reader
    if section.left_inverse:
        reader.wrong(
            ("observer", "left_inverse"), "follows from coordinates: find; leave it out", at_key=True, id="OBS213"
        )
    estimator = None
    if section.estimator is not None:
        estimator = read_estimator(texts, section.estimator, (), None)
    elif section.type != "kkl":
        reader.wrong(("observer", "estimator"), f"is required: type {section.type} estimates constants", id="OBS205")
    known = (*texts.outputs, *texts.inputs)
    return Sought(
        reader.integer(section.degree, ("observer", "degree"), 3, 1, MOST_DEGREE),
        tuple(texts.one(e, ("observer", "lambdas", i), known) for i, e in enumerate(section.lambdas or ())),
        tuple(texts.one(e, ("observer", "functions", i), texts.states) for i, e in enumerate(section.functions or ())),
        section.type,
        estimator,
        section.recast is not None,
    )


def require_kind(reader: Reader, kind: str, found: Sequence[Coordinate]) -> None:
    """Hold the coordinates against the type: kkl has none with lambda 0, pebo no others, kkl+pebo both."""
    estimated = [one.estimated for one in found]
    wanted = {"kkl": not any(estimated), "pebo": all(estimated), "kkl+pebo": any(estimated) and not all(estimated)}
    if not wanted[kind]:
        right = "kkl" if not any(estimated) else "pebo" if all(estimated) else "kkl+pebo"
        said = "coordinates with lambda 0 are estimated up to a constant, the others decay"
        reader.wrong(
            ("observer", "type"), f"{kind} does not fit these coordinates ({said}); write {right}", id="OBS504"
        )


def read_estimator(
    texts: Texts, section: EstimatorSection, names: Sequence[str], estimated: Sequence[str] | None
) -> Estimator:
    """Regressions, method and its numbers; `estimated`: coordinates with lambda 0; None: they are to be found."""
    reader, loc = texts.reader, ("observer", "estimator")
    known, chosen = (*texts.known, *names), estimated or ()
    regressions = []
    for i, each in enumerate(section.regressions):
        place: Loc = (*loc, "regressions", i)
        if each.output not in texts.outputs:
            reader.wrong((*place, "output"), unknown("output", each.output, texts.outputs, {}), id="OBS203")
        m = texts.by_name(each.m, (*place, "m"), "coordinate with lambda 0", chosen, known)
        regressions.append(Regression(each.output, texts.one(each.known, (*place, "known"), known), m))
    K = texts.by_name(section.K or {}, (*loc, "K"), "coordinate with lambda 0", chosen, texts.outputs)
    for kind, found in (("gamma", section.gamma), ("as", section.powers)):
        for name in found if isinstance(found, dict) else ():
            if name not in chosen:
                said = unknown("coordinate with lambda 0", name, chosen, {})
                reader.wrong((*loc, kind, name), said, at_key=True, id="OBS203")
    require_keys(reader, section, estimated)

    def number(name: str, otherwise: fmpq, sign: Literal[">= 0", "> 0"]) -> fmpq:
        text = getattr(section, name)
        return otherwise if text is None else reader.number(text, (*loc, name), sign)

    place = (*loc, "gamma")
    gains = section.gamma if isinstance(section.gamma, dict) else {ANY: section.gamma}
    return Estimator(
        regressions=tuple(regressions),
        method=section.method,
        alpha=number("alpha", fmpq(1), "> 0"),
        gamma={
            name: reader.number(text, (*place, name) if name else place, "> 0")
            for name, text in gains.items()
            if text is not None
        },
        kappa=number("kappa", fmpq(0), ">= 0"),
        epsilon=number("epsilon", EPSILON, "> 0"),
        K=K,
        powers=frozenset(section.powers),
        consistent=section.filters == "consistent",
    )


def require_keys(reader: Reader, section: EstimatorSection, estimated: Sequence[str] | None) -> None:
    """Refuse an estimator without what its method needs, for every coordinate, or with what follows from found ones."""
    loc: Loc = ("observer", "estimator")
    proportional, method = section.method == "proportional", f"for method {section.method}"
    for name in ("K",) if proportional else ("regressions", "alpha", "gamma"):
        if not getattr(section, name) and not (estimated is None and name == "regressions"):
            reader.wrong((*loc, name), f"is required {method}", at_key=True, id="OBS205")
    for name in ("regressions", "K") if estimated is None else ():
        if getattr(section, name):
            reader.wrong((*loc, name), "cannot be given for coordinates that are to be found", at_key=True, id="OBS213")
    if estimated is None or not reader.clean(("observer", "coordinates")) or not reader.clean(loc):
        return
    rows = {name for row in section.regressions for name in row.m}
    held: dict[str, Collection[str]] = {"K": section.K or ()} if proportional else {"regressions": rows}
    if not proportional and isinstance(section.gamma, dict):
        held["gamma"] = section.gamma
    for kind, names in held.items():
        if missing := [name for name in estimated if name not in names]:
            reader.wrong(
                (*loc, kind), f"has nothing for {', '.join(missing)}, whose constant is to be estimated", id="OBS504"
            )


def read_immersion(texts: Texts, section: ImmersionSection, typed: Typed) -> Immersion:
    """Manifold and dynamics."""
    root: Loc = ("observer",)
    chi = tuple(texts.new(name, (*root, "chi", i)) for i, name in enumerate(section.chi))
    known = (*texts.known, *chi)
    if len(section.phi) != len(section.beta):
        said = f"has {len(section.beta)} entries, and phi {len(section.phi)}; give one for each"
        texts.reader.wrong((*root, "beta"), said, id="OBS209")
    b = tuple(f"b{i + 1}" for i in range(max(len(section.beta), len(section.phi))))
    loc: Loc = (*root, "left_inverse")
    if section.left_inverse and (twice := [name for name in b if name in texts.known]):
        said = f"{twice[0]} is a signal of the plant and the value of a beta; choose another name for the signal"
        texts.reader.wrong(loc, said, id="OBS211")
    inverse = texts.by_name(section.left_inverse, loc, "state", texts.states, (*b, *texts.known))
    texts.complete(inverse, typed, loc)
    dynamics = None
    if section.dynamics is not None:
        dynamics = texts.by_name(section.dynamics, (*root, "dynamics"), "state of the observer", chi, known)
        missing = [name for name in chi if name not in section.dynamics]
        if missing and texts.reader.clean((*root, "dynamics")):
            said = f"gives no {', '.join(missing)}; add the derivative of each chi"
            texts.reader.wrong((*root, "dynamics"), said, id="OBS504")
    return Immersion(
        chi,
        tuple(texts.one(text, (*root, "phi", i), texts.states) for i, text in enumerate(section.phi)),
        tuple(texts.one(text, (*root, "beta", i), (*texts.outputs, *chi)) for i, text in enumerate(section.beta)),
        inverse,
        dynamics,
        None
        if section.Q is None
        else tuple(texts.one(text, (*root, "Q", i), known) for i, text in enumerate(section.Q)),
    )


def read_high_gain(texts: Texts, section: HighGainSection, typed: Typed) -> HighGain:
    """Injections, and other coordinates where there are some."""
    root: Loc = ("observer",)
    given = [section.states is not None, section.dynamics is not None, section.left_inverse is not None]
    if any(given) and not all(given):
        texts.reader.wrong(
            root, "other coordinates need states, dynamics and left_inverse; give all three, or none", id="OBS504"
        )
    names = tuple(texts.new(name, (*root, "states", name)) for name in section.states or ())
    known = (*texts.known, *names)
    injected = names or texts.states
    injection = {}
    for state, by_output in section.injection.items():
        loc: Loc = (*root, "injection", state)
        if state not in injected:
            texts.reader.wrong(loc, unknown("state", state, injected, {}), at_key=True, id="OBS203")
        injection[state] = texts.by_name(by_output, loc, "output", texts.outputs, texts.known)
    states = dynamics = inverse = None
    if names and all(given):
        states = texts.by_name(section.states or {}, (*root, "states"), "state", names, (*texts.states, *texts.inputs))
        dynamics = texts.by_name(section.dynamics or {}, (*root, "dynamics"), "state", names, known)
        inverse = texts.by_name(section.left_inverse or {}, (*root, "left_inverse"), "state", texts.states, known)
        texts.complete(inverse, typed, (*root, "left_inverse"))
    return HighGain(injection, section.copy == "outputs", states, dynamics, inverse)


def request_of(spec: Spec) -> Request:
    """What a spec of this family asks for."""
    assert isinstance(spec.observer, Request)
    return spec.observer


RESULTS = {
    "guarantee": ("rates", "coordinates", "recast", "phi", "beta", "dynamics"),
    "observer": ("order", "dynamics", "estimates", "initial", "coordinates", "left_inverse", "regressions", "as"),
}
