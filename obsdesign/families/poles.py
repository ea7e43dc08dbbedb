"""Where the poles of an observer have to lie: the key `poles` and `implementation.impose`, and what is said of them."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from flint import fmpq

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.certificate import Certificate
from obsdesign.dissipation.decimals import round_down, round_up
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.region import Region
from obsdesign.dissipation.scan import edge, strides
from obsdesign.families.finding import Finding, finding
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import Array, in_floats, printed, rational_number
from obsdesign.model.pencil import text
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import ENTRY, Section, key
from obsdesign.sections.values import Reader

if TYPE_CHECKING:
    from obsdesign.families.asked import Estimation

CLOSELY = 0.02  # relative, to which what would do is searched
STEPS = 12  # of a factor 2, within which it is
MEMBERS = "f = K q for a constant K of the class"
BOUND = "give its slope an upper bound, on a region if need be, or leave radius and impose out"
FREE = (
    "has one scale for each nonlinearity, and poles and implementation.impose need scales of their own; give L2 as a "
    "matrix, such as that of a design without them"
)


class Poles(Section):
    """Region of the s-plane that holds every pole of the error with a constant slope of f."""

    radius: str | None = key(ENTRY, "largest |s| of a pole s, > 0", unit="1/s", otherwise="any", example="2000")
    damping: str | None = key(
        ENTRY, "least damping ratio -Re s / |s| of a pole s, in (0, 1)", otherwise="any", example="0.5"
    )


def read_poles(reader: Reader, section: Poles | None, problem: "Estimation") -> Region | None:
    """Region that is asked for by `poles` and by `implementation.impose`; None where nothing is."""
    steps, loc = problem.steps, ("observer", "poles")
    if section is not None and problem.period is not None:
        said = "is a region of the s-plane, of continuous time; in discrete time rho bounds the poles"
        reader.wrong(loc, said, at_key=True, id="OBS213")
        return None
    if section is not None and section.radius is None and section.damping is None:
        reader.wrong(loc, "says nothing; give radius (1/s), damping, or both", id="OBS205")
    radius = read_number(reader, section.radius, (*loc, "radius")) if section else None
    damping = read_number(reader, section.damping, (*loc, "damping")) if section else None
    if damping is not None and damping >= 1:
        said = f"{float(damping):g} is not below 1: poles that are all real leave no room; 0.99 comes close"
        reader.wrong((*loc, "damping"), said, id="OBS208")
        return None
    imposed = steps is not None and steps.impose and problem.period is None
    if steps is not None and imposed and steps.method != "exact":
        return Region(radius, damping, printed(steps.period), steps.method)
    return None if radius is None and damping is None else Region(radius, damping)


def read_number(reader: Reader, text: str | None, loc: Loc) -> fmpq | None:
    """Positive number, as the decimal that a result file holds."""
    return None if text is None else printed(reader.number(text, loc, "> 0"))


def refuse_free(reader: Reader, region: Region | None, L2: Array | None) -> None:
    """Refuse a region where L2 is to be found."""
    if region is not None and L2 is None:
        reader.wrong(("observer", "L2"), FREE, id="OBS206")


def stated(certificate: Certificate, members: str = MEMBERS) -> list[str]:
    """What a certificate proves of the poles of frozen members, in words."""
    return certificate.poles.statements(members) if certificate.poles else []


def told(certificate: Certificate) -> list[str]:
    """The same in few words."""
    return [f"{', '.join(certificate.poles.words())} for every constant slope"] if certificate.poles else []


def require(file: ResultFile, region: Region | None) -> None:
    """Hold what a file says of poles and of steps against what is proved of them, by the keys of these."""
    for part, entries in (region.written() if region else {}).items():
        for name, value in entries.items():
            path = ("guarantee", part, name)
            found = file.at(*path) if isinstance(value, str) else file.number(*path)
            if found != (value if isinstance(value, str) else printed(value)):
                raise file.wrong(".".join(path), f"the spec asks for {value!r}", id="OBS707")


def eased(bounds: Bounds, holds: Callable[[Bounds], bool]) -> dict[str, tuple[float, str]]:
    """Larger radius, smaller damping or shorter period with which a solution was found, each with the rest as it is.

    `holds`: whether there is one within bounds.
    """
    found, region = dict[str, tuple[float, str]](), bounds.poles
    asked = {"radius": "allow |s| up to", "damping": "ask for damping at most", "period": "take steps of at most"}
    for name, words in asked.items():
        value = getattr(region, name) if region else None
        if value is None or region is None:
            continue

        def reached(x: float, name: str = name, region: Region = region) -> bool:
            return holds(replace(bounds, poles=replace(region, **{name: rational_number(repr(x))})))

        larger = name == "radius"
        inside, outside = strides(reached, float(value), 0.5 if larger else 2.0, STEPS)
        if inside is not None:
            limit = inside if outside is None else edge(reached, inside, outside, CLOSELY)
            found[name] = (round_up if larger else round_down)(limit, 3), words
    return found


def missed(poles: Array, region: Region) -> str:
    """That given gains are not within a region: a pole of a frozen member, in doubles; nothing where none is seen."""
    outside = region.outside(poles.ravel())
    if not len(outside):
        return ""
    pole, said = text(complex(max(outside, key=abs))), " and ".join(region.words())
    return f"with an f = K q that the types allow the error has the pole {pole}, not within {said}"


def endless(family: Incremental, region: Region | None) -> str:
    """That no disc is proved to hold the poles of every member, where slopes that act have no upper bound; or nothing.

    M22 = 0 there, and nothing else stands on the diagonal of the inequality of a disc, beside P Bf.
    """
    if region is None or (region.radius, region.period) == (None, None):
        return ""
    p, L2, q, f = in_floats(family.plant), in_floats(family.L2), 0, 0
    for i, block in enumerate(family.multiplier.blocks, start=1):
        rows, columns = slice(q, q + block.nq), slice(f, f + block.nf)
        q, f = rows.stop, columns.stop
        steep = not block.bounded and not any(part.M22.any() for part in block.generators)
        through = (p.Dqf + L2 @ p.Df)[rows].any() or p.Df[:, columns].any()
        if steep and not through and p.Bf[:, columns].any() and (p.Cq + L2 @ p.C)[rows].any():
            return f"f{i} has no upper slope bound, so that no disc is proved to hold the poles of every member"
    return ""


def findings(family: Incremental, region: Region | None) -> list[Finding]:
    """What rules a region out before any design."""
    said = endless(family, region)
    return [finding("poles", False, said, decides=True, advice=BOUND, id="OBS620")] if said else []
