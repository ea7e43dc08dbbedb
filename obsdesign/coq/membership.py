"""The f of a spec as a member of the class of a certificate: the end of a file of Coq that names no class.

For all arguments a and b, df = sum of k_i column_i (row_i . dq) with a quotient k_i of each ridge of f, see `ridges`.
The inequality of a multiplier is concave in k_i, or rises with it, so that Coq needs it at the ends of their intervals
only: there df = K dq, and the inequality is a form in dq, shown to be positive by a triangular T as everything else.
"""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from flint import fmpq

from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.decimals import comment, matrix, number
from obsdesign.coq.functions import ONE, Function, Limits, added
from obsdesign.coq.regions import UnprovedError, rational_function, signed
from obsdesign.coq.ridges import Affine, Box, Ridge, UnknownFunctionError, ridges
from obsdesign.lmi.formula import Array, rational
from obsdesign.model.multiplier import Multiplier, roots
from obsdesign.records import dataclass
from obsdesign.spec import Nonlinearity, arguments

Rays = Sequence[tuple[fmpq, Array, Array, Array]]  # scale, M11, M12, M22 of each inequality of the class
OF_A_CLASS = (
    "f satisfies the inequalities of multipliers, and lies in the hulls, for all arguments, also\n"
    "  where the words are local: the f of a spec that does so on a region only is not meant"
)
OF_THIS_F = "f is the one that is defined below"
OF_A_LOCAL_F = (
    f"{OF_THIS_F}; q and qhat stay inside the region that is defined there, at\n"
    "  all times: a run that leaves it once is not meant, not even before, where the words say as long as"
)
MAX_ENDS = 256  # of the quotients of all ridges that enter one inequality


class NoMemberError(Exception):
    """Why f was not shown to be in the class, in words."""


@dataclass(frozen=True)
class Placed:
    """A ridge among all components of q and of f."""

    ridge: Ridge
    row: Array  # (1, nq)
    column: Array  # (nf, 1)
    first: int  # component of q that is the first of its block


@dataclass(frozen=True)
class Sum:
    """The f of a spec: its ridges, the numbers of components of q and of f."""

    ridges: tuple[Placed, ...]
    nq: int
    nf: int
    box: Box  # limits of components of q

    @property
    def local(self) -> bool:
        """Whether one of its functions is known within limits only."""
        return any(one.ridge.function.limits for one in self.ridges)

    @property
    def nothing(self) -> Array:
        """Zero as a linear map of q to f."""
        return rational(np.zeros((self.nf, self.nq), dtype=int))


@dataclass(frozen=True)
class Words:
    """How the theorem about the class speaks, in Coq."""

    time: str  # variable and type
    always: str  # for all of it
    lemma: str  # about runs that stay in a region, and the design
    signals: str
    run: str  # premise about all signals, of an f
    concluded: str
    inside: str = "{always} region (q {time}) /\\ region (qh {time})"  # that q and qhat stay in a region
    design: str = "{}"  # that has the class of the one that is named
    first: str = ""  # tactic by which this is enough


@dataclass(frozen=True)
class Ending:
    """The end of a file: its last theorem, what that assumes of f, and the lines after `for_the_class`."""

    theorem: str
    premise: str
    lines: tuple[str, ...]


def ending(blocks: Sequence[Nonlinearity], rays: Rays, name: str, words: Words) -> Ending:
    """The theorem about the f of a spec, if its membership was found; else a comment that says why not.

    `name`: of the design.
    """
    try:
        f, proofs = found(blocks, rays)
    except NoMemberError as error:
        reason = str(error).replace("**", "^").replace("*", " ")  # a star may end a comment
        told = comment(f"for_the_class is about every f of its class: {reason}")
        return Ending("for_the_class", OF_A_CLASS, (told, "Print Assumptions for_the_class.", ""))
    member = "continued_f" if f.local else "f"
    lines = [
        *defined(f, words.time),
        f"Definition proofs : list proof := {listed(proofs)}%Z.",
        "",
        f"Lemma f_of_class : of_class {name} {member}.",
        f"Proof. {words.first}apply (member {words.design.format(name)} {member} ridges functions inner proofs).",
        " - vm_cast_no_check (eq_refl true).",
        f" - unfold ridges, functions. {constructed(f)}",
        " - intros q K. written_out K. unfold ridges, inner. read_off.",
        f" - intros t q K. written_out K. unfold ridges, functions, inner, {member}. read_off. Qed.",
        "",
        *(stays_inside(words) if f.local else stated(words)),
        "",
        "Print Assumptions for_this_f.",
        "",
    ]
    return Ending("for_this_f", OF_A_LOCAL_F if f.local else OF_THIS_F, tuple(lines))


def found(blocks: Sequence[Nonlinearity], rays: Rays) -> tuple[Sum, list[str]]:
    """F as a sum, and the proof of each inequality; raises `NoMemberError`.

    The functions of a sum are those that are known for all arguments, as far as that proves it.
    """
    try:
        f = whole(blocks, local=False)
        return f, [proof(ray, f.ridges, f.nothing, [MAX_ENDS]) for ray in rays]
    except NoMemberError:
        f = whole(blocks, local=True)
        return f, [proof(ray, f.ridges, f.nothing, [MAX_ENDS]) for ray in rays]


def stated(words: Words) -> list[str]:
    """The theorem about an f that is in the class."""
    return [
        "Theorem for_this_f :",
        f"  {words.run} {words.concluded}",
        "Proof. exact (for_the_class f f_of_class). Qed.",
    ]


def stays_inside(words: Words) -> list[str]:
    """The theorem about an f that is in the class where q stays in the region."""
    signals, inside = words.signals, words.inside.format(always=words.always, time=words.time[0])
    same = f"{words.lemma} f continued_f region {signals} K (fun _ _ => eq_refl) f_in_region I"
    return [
        "Lemma f_in_region : forall t q, region q -> continued_f t q = f t q.",
        "Proof. intros t q K. unfold region in K. unfold continued_f, f. inside_limits. Qed.",
        "",
        "Theorem for_this_f :",
        f"  {words.run}",
        f"  ({inside}) -> {words.concluded}",
        f"Proof. intros {signals} K I. exact (for_the_class continued_f f_of_class {signals}",
        f"  ({same})). Qed.",
    ]


def listed(items: Sequence[str]) -> str:
    """List in Coq, an item a line."""
    return "[" + ";".join(f"\n  {item}" for item in items) + "]"


def whole(blocks: Sequence[Nonlinearity], *, local: bool) -> Sum:
    """Ridges of all blocks; raises `NoMemberError`: the f of one is not known, or is no sum of known functions.

    `local`: an f with a region is one function, if it is rational.
    """
    nq, nf = sum(block.nq for block in blocks), sum(block.multiplier.member.shape[0] for block in blocks)
    ridges, limits = list[Placed](), dict[int, Limits]()
    q = f = 0
    for i, block in enumerate(blocks, start=1):
        box = {k: (low, high) for k, (low, high) in enumerate(block.region or ()) if None not in {low, high}}
        try:
            parts = split(block, i, box, local=local)
        except (UnknownFunctionError, UnprovedError) as error:
            raise NoMemberError(f"of f{i}, {error}") from None
        ridges += [placed(ridge, (nq, q), (nf, f)) for ridge in parts]
        limits |= {q + k: ends for k, ends in box.items() if any(one.function.limits for one in parts)}
        q, f = q + block.nq, f + len(block.multiplier.member)
    return Sum(tuple(ridges), nq, nf, limits)


def split(block: Nonlinearity, i: int, box: Box, *, local: bool) -> list[Ridge]:
    """Ridges of block i: one rational function, where it is to be `local`, or a sum of known functions."""
    if block.f is None:
        raise NoMemberError(f"f{i} is not given")
    names = {"q": 0} if block.nq == 1 else {}
    names |= {name: k for k, name in enumerate(arguments(block.nq)[-block.nq :])}
    if foreign := sorted(frozenset().union(*(one.names for one in block.f)) - names.keys()):
        more = "a plant in matrices may have what is known of q in its gq"
        raise NoMemberError(f"f{i} depends on {', '.join(foreign)}; {more}")
    scalar = block.nq == len(block.f) == 1
    if local and box and scalar and (slopes := declared(block.multiplier)):
        try:
            function = rational_function(f"phi{i}", block.f[0], box[0], slopes)
            return [Ridge(function, Affine.of({0: ONE}), {0: ONE})]
        except UnprovedError as error:
            reason = error
        with suppress(UnknownFunctionError):
            return ridges(block.f, names, box)
        raise reason
    return ridges(block.f, names, box)


def declared(multiplier: Multiplier) -> tuple[fmpq, fmpq | None] | None:
    """Least and largest slope that a class of scalar functions has, None if it is infinite; None if it has no such."""
    rays = [ray for block in multiplier.blocks for ray in block.generators]
    if len(rays) != 1:
        return None
    a, b, c = (M.item() for M in (rays[0].M11, rays[0].M12, rays[0].M22))
    match roots(a, b, c):
        case [low, high]:
            return low, high
        case [low] if b > 0:
            return low, None
    return None


def placed(ridge: Ridge, q: tuple[int, int], f: tuple[int, int]) -> Placed:
    """Ridge among as many components, of which those of its block begin at a place; for q and for f."""
    row, column = (rational(np.zeros(size, dtype=int)) for size in (q[0], f[0]))
    for k, c in ridge.argument.coefficients:
        row[q[1] + k] = c
    for i, c in ridge.column.items():
        column[f[1] + i] = c
    return Placed(ridge, row[None, :], column[:, None], q[1])


def proof(ray: tuple[fmpq, Array, Array, Array], left: Sequence[Placed], K: Array, ends: list[int]) -> str:
    """Proof of one inequality for df = K dq + the ridges that are left; raises `NoMemberError` if none was found.

    `ends`: how many more ends may be looked at; the number is counted down.
    """
    _, M11, M12, M22 = ray
    if not left:
        ends[0] -= 1
        if ends[0] < 0:
            raise NoMemberError("it is a sum of too many functions")
        across = M12 @ K
        return f"Ends {told(shown(M11 + across + across.mT + K.mT @ M22 @ K))}"
    one, rest = left[0], left[1:]
    along, curved = M12 @ one.column, M22 @ one.column
    low, high = one.ridge.function.least, one.ridge.function.most
    turn = one.column @ one.row
    met = one.column[:, 0] != 0
    if not (M12[:, met].any() or M22[:, met].any() or M22[met].any()):
        return f"Silent ({proof(ray, rest, K, ends)})"
    if low == high:
        return f"Fixed ({proof(ray, rest, K + low * turn, ends)})"
    if high is not None:
        shown(-one.column.mT @ curved)
        return f"Both ({proof(ray, rest, K + low * turn, ends)}) ({proof(ray, rest, K + high * turn, ends)})"
    if curved.any():
        raise NoMemberError("its slope has no bound")
    rise = along @ one.row
    return f"Rising {told(shown(rise + rise.mT))} ({proof(ray, rest, K + low * turn, ends)})"


def told(columns: list[list[int]]) -> str:
    """Columns of T on one line."""
    return triangle(columns).replace("\n", "")


def shown(S: Array) -> list[list[int]]:
    """Columns of T for S >= 0; raises `NoMemberError` for others."""
    try:
        return congruence(S)
    except ValueError:
        raise NoMemberError("its slopes reach beyond the class that is certified, as far as is seen") from None


def defined(f: Sum, time: str) -> list[str]:
    """Definitions of f: as it is read, and as a sum of ridges."""
    names = " ".join(f"let q{k + 1} := nth {k} q 0 in" for k in range(f.nq))
    head = f"({time}) (q : list R) : list R :={names and chr(10)}  {names}\n"
    inner = [one.ridge.argument.text(one.first) for one in f.ridges]
    known = [one.ridge.function for one in f.ridges]
    continued = [function.everywhere() for function in known]
    lines = [line for function in known for line in function.lines]
    lines += ["(* The f of the spec *)", f"Definition f {head}  {values(f, known, inner)}."]
    if f.local:
        limits = [f"{signed(low)} <= nth {k} q 0 <= {signed(high)}" for k, (low, high) in f.box.items()]
        lines += [
            "(* The region of its types, and f continued outside by lines *)",
            "Definition region (q : list R) : Prop := " + " /\\ ".join(limits) + ".",
            f"Definition continued_f {head}  {values(f, continued, inner)}.",
        ]
    return [
        *lines,
        "(* The same as the sum of column * function (row . q + shift); inner: the arguments of the functions *)",
        f"Definition functions : list (R -> R) := [{'; '.join(function.term for function in continued)}].",
        f"Definition inner (q : list R) : list R := {names} [{'; '.join(inner)}].",
        f"Definition ridges : list ridge := {listed([record(one) for one in f.ridges])}%Q.",
    ]


def values(f: Sum, functions: Sequence[Function], inner: Sequence[str]) -> str:
    """Components of f, as sums of values of functions."""
    terms = [function.at(argument) for function, argument in zip(functions, inner, strict=True)]
    rows = [
        added([(one.column[i, 0], term) for one, term in zip(f.ridges, terms, strict=True) if one.column[i, 0] != 0])
        for i in range(f.nf)
    ]
    return f"[{'; '.join(rows)}]"


def record(one: Placed) -> str:
    """The numbers of a ridge."""
    function, most = one.ridge.function, "None"
    if function.most is not None:
        most = f"Some {number(function.most)}%Q"
    ends = f"least := {number(function.least)}; most := {most}"
    place = f"row := {matrix(one.row)[1:-1]}; shift := {number(one.ridge.argument.shift)}"
    return f"{{| {place}; column := {matrix(one.column)}; {ends} |}}"


def constructed(f: Sum) -> str:
    """Tactic that gives each ridge the lemma of its function."""
    lemmas = "".join(f"exact {one.ridge.function.everywhere().lemma}|" for one in f.ridges)
    return f"repeat apply List.Forall2_cons; [{lemmas}apply List.Forall2_nil]."
