"""What to write in place of a number with a unit: numbers of a spec have none; known units are told in SI."""

import re
from collections.abc import Collection

from flint import fmpq

PREFIXES = {"p": -12, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "d": -1, "k": 3, "M": 6, "G": 9, "T": 12}
SI = re.findall(r"\w+", "m s A K N Pa J W V F H Ohm ohm Ω Ω S T Wb Hz C rad mol cd")
PREFIXED = {*SI, "g", "bar", "l"}
UNITS = {  # exactly so many of an SI unit
    **{name: (fmpq(1), name) for name in (*SI, "kg", "1")},
    **{"g": (fmpq(1, 1000), "kg"), "t": (fmpq(1000), "kg"), "bar": (fmpq(10**5), "Pa"), "l": (fmpq(1, 1000), "m^3")},
    **{"min": (fmpq(60), "s"), "h": (fmpq(3600), "s"), "sec": (fmpq(1), "s")},
}
WRITTEN = {  # arithmetic that a spec reads
    **dict.fromkeys(("deg", "degree", "degrees", "°"), "{}*pi/180 for so many rad"),
    "rpm": "{}*2*pi/60 for so many rad/s",
    "%": "{}/100",
    "dB": "10**({}/20) for a ratio of amplitudes",
}
NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
FACTOR = r"[a-zA-Zµμ°%ΩΩ]+(?:(?:\^|\*\*)?-?[0-9])?"
QUANTITY = re.compile(rf"({NUMBER})(\s*{FACTOR}(?:[*/·]{FACTOR})*|\s+1/{FACTOR})")
DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+")


def misread(text: str, names: Collection[str]) -> str | None:
    """What to say of a number with a unit or with a decimal comma; None of any other text, or with one of the names."""
    if DECIMAL_COMMA.fullmatch(text):
        return f"a decimal point is a point, found {text}; write {text.replace(',', '.')}"
    found = None if re.fullmatch(NUMBER, text) else QUANTITY.fullmatch(text)
    if found is None or set(names).intersection(re.findall(r"[a-zA-Z]+", found[2])):
        return None
    return f"a number has no unit, found {text}; write {without(found[1], found[2].strip())}"


def without(number: str, unit: str) -> str:
    """What to write for a number with a unit."""
    if unit in WRITTEN:
        return WRITTEN[unit].format(number)
    known = in_si(unit)
    if known is None:
        return "it in the unit of your spec, without the unit"
    scale, name = known
    return f"{float(number) * float(scale.p) / float(scale.q):.12g} for so many {name}"


def in_si(unit: str) -> tuple[fmpq, str] | None:
    """How many of which SI unit a product or quotient of units is; None where a part is not known."""
    scale, said = fmpq(1), ""
    for sign, name, power in re.findall(r"([*/·]?)(1|[^\W\d_]+)(?:\^|\*\*)?(-?[0-9])?", unit):
        part = known_unit(name)
        if part is None:
            return None
        scale *= part[0] ** ((-1 if sign == "/" else 1) * int(power or 1))
        said += sign + part[1] + (f"^{power}" if power else "")
    return (scale, said) if said else None


def known_unit(name: str) -> tuple[fmpq, str] | None:
    """How many of which SI unit a unit is; None where it is not known."""
    if name in UNITS:
        return UNITS[name]
    prefix, rest = name[:1], name[1:]
    if prefix not in PREFIXES or rest not in PREFIXED:
        return None
    scale, said = UNITS[rest]
    return scale * fmpq(10) ** PREFIXES[prefix], said
