"""Specs to begin with, `PLANT.FAMILY.yaml` beside this module: each is complete, and solves and simulates as it is."""

from collections.abc import Iterator, Sequence
from importlib.resources import files

from obsdesign.errors import UsageError
from obsdesign.families import FAMILIES
from obsdesign.sections.words import nearest

PLANTS = ("pendulum", "motor", "fan", "cell", "vehicle", "single-track", "converter", "tank", "matrices")


def pairs() -> Iterator[tuple[str, str]]:
    """Plants and families that have a spec together, those to begin with first."""
    here = {path.name for path in files(__name__).iterdir()}
    return ((plant, family) for plant in PLANTS for family in FAMILIES if f"{plant}.{family}.yaml" in here)


def matching(plant: str, family: str) -> list[tuple[str, str]]:
    """Pairs of this plant and this family, or of any where it is empty.

    Raises `UsageError`: there is none.
    """
    found = [pair for pair in pairs() if pair[0] == (plant or pair[0]) and pair[1] == (family or pair[1])]
    if found:
        return found
    families = {which: [f for p, f in pairs() if p == which] for which in PLANTS}
    if plant in families:
        said = f"no spec to begin with has the plant {plant} and the family {family}"
        raise UsageError(f"{said}; the families of {plant}: {', '.join(families[plant])}", id="OBS913")
    if plant:
        raise UsageError(f"unknown plant {plant}{among(plant, PLANTS)}", id="OBS913")
    known = list(dict.fromkeys(f for _, f in pairs()))
    raise UsageError(f"no spec to begin with is of the family {family}{among(family, known)}", id="OBS913")


def among(word: str, known: Sequence[str]) -> str:
    """What is allowed in place of a word, with the one that was probably meant."""
    meant = nearest(word, known)
    return f"{f'; did you mean {meant}?' if meant else ';'} allowed: {', '.join(known)}"


def text(plant: str, family: str) -> str:
    """Text of the spec of a pair."""
    return files(__name__).joinpath(f"{plant}.{family}.yaml").read_text("utf-8")
