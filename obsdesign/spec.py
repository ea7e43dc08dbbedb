"""A spec, read: everything about one estimation problem in the types of the design and of the simulation."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from flint import fmpq

from obsdesign.errors import ObsdesignError, Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.discretise import Continuous
from obsdesign.model.disturbance import Generator, augment
from obsdesign.model.equations import Equations, Typed, free, from_matrices
from obsdesign.model.filtered import channels, filtered
from obsdesign.model.plant import Cancelling, Plant
from obsdesign.nonlinearities import Multiplier, combine
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, SINCE_ZERO, Ends, Range, Restriction, outward
from obsdesign.records import dataclass, field, replace
from obsdesign.sections.changes import claimed, opened
from obsdesign.tables.text import at_least, at_most
from obsdesign.trial import Implementation, Level, Recorded, Simulation

PROVED = "is proved from f"  # of a type, in a note
MODEL = "of the plant in samples, a model of the continuous one"  # of a claim
DOUBLES = "its irrational numbers are the doubles that the notes name"


def numbered(letter: str, count: int) -> tuple[str, ...]:
    """Default names: x1, x2, .."""
    return tuple(f"{letter}{i + 1}" for i in range(count))


def named_by(path: str) -> str:
    """Name of a spec whose text gives it none."""
    return Path(path).stem.strip("<>")


def arguments(nq: int) -> tuple[str, ...]:
    """Names of the argument of a nonlinearity in its expressions; a single component is also q."""
    return ("q", "q1") if nq == 1 else numbered("q", nq)


@dataclass(frozen=True)
class Nonlinearity:
    """One block f_i(t, y, q_i) of f."""

    type: str  # as written in the spec, for tables and messages
    nq: int
    multiplier: Multiplier
    f: tuple[Expression, ...] | None  # in t, the outputs, the inputs and q (or q1, q2, ..); None: not to be simulated
    region: tuple[Ends, ...] | None = None  # of each component of q_i, where the type holds; None: all
    others: Mapping[str, Ends] = field(default_factory=dict)  # of other variables of f (t, outputs, inputs), likewise
    lipschitz: tuple[
        fmpq, ...
    ] = ()  # constant of f_i, or one for each component that has its own; none is known: empty
    assumed: str = ""  # what is known of a type that is not proved of f_i; empty: it is proved, or f_i is named by it
    entry: Any = None  # the type as a spec has it, with exact numbers: a name, or a mapping with its data
    term: str = ""  # of a plant as equations: f_i in the names of the plant
    arguments: tuple[str, ...] = ()  # likewise, what each component of q_i is

    def argument(self, k: int, otherwise: str) -> str:
        """What component k of its argument is called in a sentence: in the names of the plant, where it has some."""
        return self.arguments[k] if self.arguments else otherwise

    def restricted(self, region: Mapping[str, Ends]) -> Restriction:
        """F on the region of its type, with other ranges of some variables."""
        assert self.f
        own = {f"q{k}": ends for k, ends in enumerate(self.region or (), start=1)}
        return Restriction.of(self.f, self.nq, {"t": SINCE_ZERO, **self.others, **own, **region})


def limited(blocks: Sequence[Nonlinearity]) -> Iterator[tuple[int, int, int, Range]]:
    """Number of the block, component in it, component of q, and limits, of each component that has a limit."""
    first = 0
    for i, block in enumerate(blocks, start=1):
        for k, ends in enumerate(block.region or ()):
            if ends != EVERYWHERE:
                yield i, k, first + k, outward(ends)
        first += block.nq


class Request(Protocol):
    """What is asked of the observer, in the numbers of the spec: what any stage may ask of any family."""

    @property
    def type(self) -> str:
        """Value of `observer.type`."""

    @property
    def drive(self) -> str:
        """Letter of what drives the augmented plant, as the source of the family has it: v, or w."""

    @property
    def reconstruct(self) -> bool:
        """Whether w is estimated by pinv(B) L1 (yhat - y)."""

    @property
    def filtered(self) -> bool:
        """Whether the estimate of a sample knows the y of that sample; only in discrete time."""

    @property
    def gains(self) -> Mapping[str, Array] | None:
        """Gains to be analyzed instead of designed."""

    @property
    def restrictions(self) -> Sequence[str]:
        """Bounds on what a design may use, in words."""


class Called(type):
    """Type of `Spec`: with the parts of a spec it makes the dataclass, with sections of a file it reads them."""

    build: Callable[[Mapping[str, Any]], Any]  # of `reading`, which sets it: what reads is above what is read

    def __call__(cls, **parts: Any) -> Any:
        """Return a spec; only its own parts have a plant."""
        return super().__call__(**parts) if "plant" in parts else cls.build(parts)


@dataclass(frozen=True, repr=False)
class Spec(metaclass=Called):
    """One estimation problem.

    `Spec(system={"A": A, "C": C}, observer={"type": "l2"}, ..)` reads the sections of a spec file from Python values
    (see `reading.build`): arrays, numbers, lists, text; numbers and messages are those of the same file.
    """

    if TYPE_CHECKING:

        def __init__(self, **sections: Any) -> None:
            """Sections of a spec file, or the parts of a spec."""

    name: str
    source: str
    description: str
    text: str  # the file, whole
    path: str  # as typed
    plant: Plant[Exact]  # (1)
    generator: Generator  # (2)
    model_states: tuple[str, ...]  # names of xm
    drives: tuple[str, ...]  # names of v
    inputs: tuple[str, ...]  # names of the known inputs u
    units: Mapping[str, str]
    nonlinearities: tuple[Nonlinearity, ...]  # the plant's, then the disturbance model's
    gx: tuple[Expression, ...]  # (n,) known terms, of t, the outputs and the inputs
    gq: tuple[Expression, ...]  # (nq of the plant,)
    gy: tuple[Expression, ...]  # (ny,) of t and the inputs
    H: Array  # (nz, n + nm): z = H e
    H_names: tuple[str, ...]
    weights: Mapping[str, fmpq]  # of z by name, where some are given
    noise: Mapping[str, Level]  # of outputs, by name
    observer: Request
    simulation: Simulation | None
    expect: Mapping[str, Any]
    typed: Typed | None  # the plant as equations, of a family that takes it so; its matrices are zero then
    notes: tuple[str, ...]  # what the reader did that a user should know, such as rounding sqrt(2)
    rounded: bool = False  # whether the design has irrational numbers, as the nearest doubles
    unused: tuple[str, ...] = ()  # keys that have no effect on what is asked, in sentences
    reproduces: tuple[str, ...] = ()  # figures and tables of the source
    changes: tuple[str, ...] = ()  # keys that have other values than in the text, such as observer.alpha=0.5
    as_equations: bool = False  # whether the plant is written as equations, which were split into the matrices
    period: fmpq | None = None  # s, of a plant x+ = A x + ..; None: x' = A x + ..
    continuous: Continuous | None = None  # plant that this one in samples stands for
    implementation: Implementation | None = None
    data: Recorded | None = None
    origin: str = ""  # of a spec that came in a result: the path that it had there

    @contextmanager
    def placed(self) -> Iterator[None]:
        """Give errors that are raised within the file of the spec, and the line and column of their key."""
        try:
            yield
        except ObsdesignError as error:
            error.problems = error.args = tuple(map(self.located, error.problems))
            raise

    def located(self, problem: Problem) -> Problem:
        """Return the same problem with its place; a spec of Python values has no lines."""
        if problem.file or problem.message.startswith("--"):  # of an option
            return problem
        if not problem.key or self.path.startswith("<"):
            return replace(problem, file=self.path)
        loc = [int(name) if name.isdigit() else name for name in re.findall(r"[^.\[\]]+", problem.key)]
        placed = opened(self.text, self.path, self.changes).problem(tuple(loc), problem.message, id=problem.id)
        return replace(placed, rows=problem.rows)

    def __repr__(self) -> str:
        return f"<spec {self.name!r}: {self.observer.type}, {self.plant.n} states>"

    @property
    def disturbed(self) -> bool:
        """Whether anything drives the augmented plant; otherwise gamma means nothing."""
        return bool(self.posed.B.shape[1])

    @property
    def cancelled(self) -> tuple[str, ...]:
        """Channels of w that are in no equation of the error, where the observer cancels some."""
        asked = self.observer
        return tuple(self.plant.exogenous[k] for k in asked.cancel) if isinstance(asked, Cancelling) else ()

    @cached_property
    def augmented(self) -> Plant[Exact]:
        """The plant with the disturbance model appended, (10)."""
        return augment(self.plant, self.generator, self.model_states, self.drives)

    @cached_property
    def posed(self) -> Plant[Exact]:
        """The plant of whose errors the inequalities are: not the augmented one where estimates know y at once."""
        if isinstance(self.observer, Cancelling):
            return self.observer.posed(self.augmented)
        return filtered(self.augmented) if self.observer.filtered else self.augmented

    @property
    def reserved(self) -> tuple[str, ...]:
        """Names of w where xm may have the same: names that no signal of the augmented plant has."""
        taken = {*self.plant.states, *self.model_states, *self.inputs, *self.plant.outputs}
        return tuple(free(name, taken) for name in self.plant.exogenous)

    def equations(self, plant: Plant[Exact]) -> Equations:
        """Equations of the plant, or of it with the disturbance model, with the nonlinearities and known terms.

        Raises `UsageError` if a nonlinearity has no f.
        """
        time: Literal["continuous", "discrete"] = "continuous" if self.period is None else "discrete"
        if self.typed:
            taken = {"t", *plant.states, *self.inputs, *plant.outputs}
            exogenous = tuple(free(name, taken) for name in plant.exogenous)
            driven = dict(zip(self.plant.exogenous, map(Expression.variable, exogenous), strict=False))
            further = zip(plant.outputs[len(self.plant.outputs) :], driven.values(), strict=False)
            made = self.typed.equations.substituted(driven, exogenous=exogenous)
            return replace(made, outputs={**made.outputs, **dict(further)}, time=time)
        width = len(plant.Cq)
        blocks: list[tuple[tuple[Expression, ...], int]] = []
        for i, block in enumerate(self.nonlinearities):
            if sum(nq for _, nq in blocks) == width:
                break
            if block.f is None:
                said = "has no `f`, which a simulation needs (a design does not)"
                raise UsageError(Problem(said, key=f"nonlinearities[{i}]", id="OBS402"))
            blocks.append((block.f, block.nq))
        known = [
            (*g, *[Expression.number(0)] * (rows - len(g)))
            for g, rows in ((self.gx, plant.n), (self.gq, width), (self.gy, len(plant.C)))
        ]
        return replace(from_matrices(plant, blocks, known, self.inputs), time=time)

    @cached_property
    def multiplier(self) -> Multiplier:
        """What the design may assume of f = (f_1, .., f_k)."""
        return combine(block.multiplier for block in self.nonlinearities)

    @property
    def validity(self) -> str | None:
        """Where the types hold, and with them every guarantee: a clause for a sentence; None: everywhere."""
        clauses = dict.fromkeys(clause for i in range(len(self.nonlinearities)) for clause in self.limits(i))
        return f"as long as {' and '.join(clauses)}" if clauses else None

    @property
    def idle(self) -> list[str]:
        """Nonlinearities and disturbances that act on nothing, and keys without effect, in sentences."""
        column, found = 0, []
        used = {name for _, side in self.typed.equations.sides() for name in side.names} if self.typed else set()
        for name, *columns in zip(self.plant.exogenous, self.plant.B.T, self.plant.D.T, self.plant.Dq.T, strict=True):
            if name not in used and not any(part.any() for part in columns):
                found.append(f"the disturbance {name} acts on nothing: it enters neither the dynamics nor an output")
        for i, block in enumerate(self.nonlinearities):
            mine = slice(column, column := column + block.multiplier.member.shape[0])
            if not any(M[:, mine].any() for M in (self.augmented.Bf, self.augmented.Df, self.augmented.Dqf)):
                found.append(f"nonlinearities[{i}] acts on nothing: its columns of Bf, Df and Dqf are zero")
        return [*found, *self.unused]

    @property
    def assumed(self) -> list[str]:
        """Types that are not proved, in words, with what was searched."""
        names = ["f"] if len(self.nonlinearities) == 1 else numbered("f", len(self.nonlinearities))
        blocks = zip(names, self.nonlinearities, strict=True)
        return [f"{block.type} of {block.term or name} ({block.assumed})" for name, block in blocks if block.assumed]

    @property
    def conditions(self) -> list[str]:
        """What every design keeps to, and where it holds: for the title of a figure."""
        local = [f"local: {self.validity}"] if self.validity else []
        model = ["of a model in samples"] if self.continuous else []
        return [*(self.observer.restrictions if not self.observer.gains else ()), *local, *model]

    @property
    def signals(self) -> str | None:
        """What z and v are, or w where the family calls it so; None where nothing drives the plant."""
        if not self.disturbed:
            return None
        x = (*self.plant.states, *self.model_states)
        named = {*x, *self.plant.exogenous}.issuperset(self.H_names)
        z = f"error of the estimated {', '.join(self.H_names if named else x)}"
        modelled = len(self.generator.Am) > 0
        v = self.drives if modelled else [name for name in self.plant.exogenous if name not in self.cancelled]
        driven = f"{self.observer.drive}: {', '.join(v)}"
        if modelled:
            driven += f", which drives the model of {', '.join(self.plant.exogenous)}"
        if self.observer.filtered and (late := channels(self.augmented)[1]).any():
            driven += f"; {', '.join(np.array(v)[late])} at the next sample"
        return f"z: {z if named else f'H e, e the {z}'}; {driven}"

    @property
    def provisos(self) -> list[str]:
        """Where a guarantee of the observer holds, and what it assumes: clauses for the end of a sentence."""
        assumed = [f"assumed: {' and '.join(self.assumed)}"] if self.assumed else []
        model = [*([MODEL] if self.continuous else []), *([DOUBLES] if self.rounded else [])]
        return [*([f"local: {self.validity}"] if self.validity else []), *assumed, *model, *self.changed]

    @property
    def changed(self) -> list[str]:
        """That a claim is of the spec with other values of some keys, as a clause; a trial changes no claim."""
        told = claimed(self.changes)
        return [f"of the spec with {', '.join(told)}"] if told else []

    def starts_outside(self) -> Iterator[Problem]:
        """Arguments of f that the first estimate has outside the region of its type, with what to write."""
        if self.simulation is None:
            return
        q = self.augmented.Cq.astype(float) @ self.simulation.xhat0
        for i, k, column, (low, high) in limited(self.nonlinearities):
            known = self.gq[column] if column < len(self.gq) else Expression.number(0)
            if known.names - {"t"} or self.augmented.Dqf[column].any():
                continue
            value = q[column] + known.scalar(["t"])(0.0)
            if not low <= value <= high:
                block = self.nonlinearities[i - 1]
                name = block.argument(k, f"q{k + 1} of nonlinearities[{i - 1}]")
                where = f"{name} to {value:.4g}, outside its region [{low:g}, {high:g}]"
                said = f"it sets {where}, where nothing is proved; give an xhat0 within it"
                yield self.located(Problem(said, key="simulation.xhat0", id="OBS806"))

    def limits(self, i: int) -> list[str]:
        """What must hold for the type of one nonlinearity."""
        block = self.nonlinearities[i]
        whose = f" of nonlinearities[{i}]" if len(self.nonlinearities) > 1 else ""
        own = ("q",) if block.nq == 1 else numbered("q", block.nq)
        known = ((block.argument(k, own[k] + whose), ends) for k, ends in enumerate(block.region or ()))
        limited = [(f"{q} and its estimate stay", ends) for q, ends in known]
        limited += [(f"{name} stays", ends) for name, ends in block.others.items()]
        return [
            f"{what} in [{'-inf' if low is None else at_most(low)}, {'inf' if high is None else at_least(high)}]"
            for what, (low, high) in limited
            if (low, high) != EVERYWHERE
        ]
