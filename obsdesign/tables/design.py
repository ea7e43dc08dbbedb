"""Results as text, and points of a search: curves over one parameter, trade-offs over a weight, surfaces over both."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from obsdesign.families import FAMILIES
from obsdesign.families.analysis import UNAIDED
from obsdesign.tables.text import UNBOUNDED, UNSTABLE, at_least, at_most, limit_text, pole_text

QUANTITIES = ("lipschitz", "gamma")
SAFE = {"lipschitz": at_least, "gamma": at_most}  # how what is proved is rounded
LONGEST = 60  # points that are listed one by one
FEW = 4  # estimates whose noise is listed at each
LIMITS = {"limit": "limit", "limit_bounded": "within bounds"}
MEMBERS = "proved of every f = K q that the claim is about, K constant"
UNPROVED = "what follows of these gains is their claim only: it is not proved"
ATTENUATION = ("gamma", "peak gain")  # rows that say nothing where no disturbance acts

Rows = list[tuple[str, str]]


def design_rows(content: Mapping[str, Any]) -> Rows:
    """What an engineer wants to know of a result, from the result file."""
    rows = [("problem", content["name"]), ("status", content["status"])]
    rows += [("claimed", UNPROVED)] if content["status"] == "uncertified" else []
    rows += [("set", content["set"])] if "set" in content else []
    claimed, made = content.get("guarantee", {}), content.get("observer", {})
    family = FAMILIES[made["type"]] if made else None
    rows += [*family.proved(made, claimed), *places(claimed)] if family else []
    rows += [("signals", content["signals"])] if family and "gamma" in claimed and content.get("signals") else []
    rows += [("local", content["local"])] if "local" in content else []
    rows += [("assumed", text) for text in content.get("assumed", [])]
    rows += [*limits(claimed), *background(claimed)]
    rows += family.figures(made) if family else []
    rows += analysis(content.get("analysis", {}), claimed)
    rows = rows if content.get("signals", True) else [row for row in rows if not attenuates(row)]
    rows += proof(content.get("certificate", {}))
    if "diagnosis" in content:
        found = content["diagnosis"]
        rows += [("reason", f"{found['reason']} [{found['id']}]")] if "id" in found else []
        rows += [("suggestion", str(found["suggestion"]))] if "suggestion" in found else []
    rows += search_rows(content.get("search", {}))
    return rows + [("note", note) for note in content.get("notes", [])]


def places(claimed: Mapping[str, Any]) -> Rows:
    """Where the poles of every frozen member are proved to lie, and the steps in which they decay."""
    units = {"radius": "|s| <= {:g} 1/s", "damping": "damping >= {:g}"}
    said = [units[name].format(value) for name, value in claimed.get("poles", {}).items()]
    rows = [("poles within", f"{', '.join(said)}   {MEMBERS}")] if said else []
    if "implementation" in claimed:
        steps = claimed["implementation"]
        how = f"{steps['period']:g} s by {steps['method']}"
        rows += [("stable steps", f"{how}   {MEMBERS}")]
    return rows


def attenuates(row: tuple[str, str]) -> bool:
    """Whether a row says how much of a disturbance reaches the error."""
    name, text = row
    return name in ATTENUATION or (name in LIMITS.values() and text.startswith("gamma"))


def analysis(found: Mapping[str, Any], claimed: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is computed over frozen members of the class: poles, steps, and gains with and without the observer."""
    if not found:
        return []
    rows = [*worst(found), *steps(found), *noise(found)]
    low, high = (found.get("peak_gain", {}).get(end) for end in ("least", "most"))
    ends = [] if low is None else [f"at least {at_least(low, 4)}"]
    ends += [] if high is None else [f"at most {at_most(high, 4)} by V of the certificate"]
    rows += [("peak gain", f"{', '.join(ends)}   sup|z| for sup|v| = 1")] if ends else []
    rows += [("truth", text) for text in truth(found["truth"], claimed)] if "truth" in found else []
    gains = [(UNAIDED[name], gain) for name, gain in found["no_observer"].items() if gain is not None]
    without = ", ".join(f"{gain:.6g} with {how}" for how, gain in gains)
    return [*rows, *([("no observer", f"a gain of {without}")] if without else [])]


def worst(found: Mapping[str, Any]) -> Rows:
    """The slowest pole, in 1/s or of samples."""
    if "worst_pole" not in found:
        return []
    pole = found["worst_pole"]
    if pole is None:
        return [("worst pole", UNBOUNDED)]
    size = " 1/s" if "largest_step" in found else f", |pole| = {abs(complex(*pole)):.4g}"
    return [("worst pole", f"{pole_text(pole)}{size}   the slowest that was found of f = K q of the types")]


def steps(found: Mapping[str, Any]) -> Rows:
    """Largest steps of continuous time, by method; samples leave no step to choose."""
    if "largest_step" not in found:
        return []
    methods = {"Euler": "euler", "Runge-Kutta 4": "rk4", "exact linear part": "exact"}
    known = {name: found["largest_step"][key] for name, key in methods.items()}
    told = ", ".join(f"{at_least(step, 3)} s ({name})" for name, step in known.items() if step)
    return [("largest step", told or (UNBOUNDED if known["Euler"] is None else UNSTABLE))]


def noise(found: Mapping[str, Any]) -> Rows:
    """Rms of each error for white noise of each output, of density 1, and of rms 1 where that can be told."""
    kinds = {"noise_density": "unit/sqrt(Hz)", "noise_rms": "unit rms"}
    known = {key: found[key] for key in kinds if found.get(key)}
    if known.get("noise_rms") == known.get("noise_density"):
        known.pop("noise_density", None)  # of samples they are one number
    rows = [
        (key.replace("_", " "), f"{sizes}   rms for 1 {kinds[key]} of {output}")
        for key, gains in known.items()
        for output, sizes in by_output(gains).items()
    ]
    said = {"noise_error": "rms for the declared noise", "gain_by_channel": "of v to z, each alone, where f = K q"}
    return rows + [(key.replace("_", " "), f"{listed(found[key])}   {said[key]}") for key in said if found.get(key)]


def listed(sizes: Mapping[str, float]) -> str:
    """Numbers by name, in few digits."""
    return ", ".join(f"{name} {size:.3g}" for name, size in sizes.items())


def by_output(gains: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
    """Sizes of the errors in one line for each output."""
    outputs = dict.fromkeys(output for row in gains.values() for output in row)
    return {y: listed({name: row[y] for name, row in gains.items()}) for y in outputs}


def truth(found: Mapping[str, Any], claimed: Mapping[str, Any]) -> list[str]:
    """What no claim can be better than, beside what is claimed: the longest interval, gamma and the decay."""
    parts, rate = [], claimed.get("decay", 0.0)
    if found["pattern_limit"]:
        limit, proved = found["pattern_limit"], claimed.get("T2_max", claimed.get("T2"))
        short = "no such decay" if rate else "unstable"
        recurring = "periodic" if len(limit["gaps"]) == 1 else f"{len(limit['gaps'])} intervals that recur"
        known = f"T2 proved {at_least(proved, 4)} s, " if proved else ""
        parts += [f"{known}{short} from {at_most(limit['T2'], 4)} s ({recurring})"]
    gains = [gain for name, gain in found.get("gamma", {}).items() if name != "gaps" and gain is not None]
    weight = f" with the weight exp({rate:g} t)" if rate else ""
    parts += [f"gamma at least {at_least(max(gains), 4)}{weight}"] if gains else []
    growth = found["pattern"]["growth"]
    parts += [f"decay at most {at_most(-growth, 4)} 1/s"] if growth is not None else []
    return [f"{part}   of {found['of']}" for part in parts]


def background(claimed: Mapping[str, Any]) -> Rows:
    """What bounds the limit, and what the relaxations cost."""
    rows = []
    if "widened" in claimed:
        wide = claimed["widened"]
        rows += [("widened", f"gamma {wide['gamma']:.6g} as if the Lipschitz constant were {wide['lipschitz']:.6g}")]
    if "ceiling" in claimed:
        rows += [("ceiling", f"lipschitz {at_most(claimed['ceiling'])}   no gain tolerates more")]
    return rows + [("relaxation", compared(row)) for row in claimed.get("comparison", [])]


def compared(row: Mapping[str, Any]) -> str:
    """One relaxation of a comparison."""
    parts = [f"{row['relaxation']:<12}"]
    if row.get("limit"):
        parts.append(f"limit {limit_text(row['limit'])}")
    if "certified" in row:
        parts.append(f"certified {certified(row['certified'])}")
    if row.get("status") in ("refused", "undecided"):
        parts.append(f"{row['status']}: {row.get('reason', 'it is not known why')}")
    elif "reason" in row:
        parts.append(row["reason"])
    return "   ".join(parts)


def limits(claimed: Mapping[str, Any]) -> Rows:
    """Limits of the objective."""
    known = ((name, limit_text(claimed.get(key, {}))) for key, name in LIMITS.items())
    return [(name, text) for name, text in known if text]


def proof(certificate: Mapping[str, Any]) -> Rows:
    """What was proved in one line, led by the main inequality, and each condition that was not."""
    checks = list(conditions(certificate))
    held = [check["name"] for check in checks if check["holds"]]
    rows = [("NOT PROVED", check["name"]) for check in checks if not check["holds"]]
    if held:
        rest = f", and {len(held) - 1} further conditions" if len(held) > 1 else ""
        rows.append(("proved", f"{held[0]}{rest}, in rationals"))
    return rows


def conditions(certificate: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Conditions of a certificate and of those within it."""
    yield from certificate.get("checks", [])
    for part in certificate.values():
        if isinstance(part, Mapping):
            yield from conditions(part)


def search_rows(search: Mapping[str, Any]) -> Rows:
    """Points of a search, in the form that fits them."""
    weighed = any("weight" in point for point in search.get("points", []))
    return front(search) if weighed else list(curves(search))


def curves(search: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Points of a search, or of each of its curves."""
    parameter = search.get("parameter", "alpha")
    for curve in search.get("curves", [{"points": search.get("points", [])}]):
        if "injection" in curve:
            yield "curve", f"{curve['injection']}, {curve['relaxation']}"
        yield from (("curve", f"{parameter} {p[parameter]:<10.4g} {reached(p)}") for p in curve["points"])


def reached(point: Mapping[str, Any]) -> str:
    """One point of a curve."""
    if "gamma" not in point:
        return f"T2 {point['T2']:.6g}" if "T2" in point and "decay" in point else str(point["status"])
    proved = point.get("certified")
    parts = [f"gamma {point['gamma']:.6g}"]
    parts += [f"certified {at_most(proved['gamma'])}, {size_text(proved)}"] if proved else []
    noise = {**point.get("noise_density", {}), **point.get("noise_error", {})}
    parts += [f"noise {listed(noise)}"] if 0 < len(noise) <= FEW else []
    return "   ".join(parts)


def front(search: Mapping[str, Any]) -> Rows:
    """Points of a curve, or a summary of a surface."""
    points, parameters = search["points"], search.get("parameters", [search["parameter"]])
    if len(points) > LONGEST:
        return summary(points, parameters)
    at = (", ".join(f"{key} {point[key]:<7.4g}" for key in parameters) for point in points)
    return [("curve", f"{where} {shown(point)}") for where, point in zip(at, points, strict=True)]


def shown(point: Mapping[str, Any]) -> str:
    """One point."""
    if not solvable(point):
        return str(point["status"])
    parts = [quantities(point)]
    parts += [f"certified {certified(point['certified'])}"] if "certified" in point else [str(point["status"])]
    parts += [] if point.get("attained", True) else ["not attained"]
    return "   ".join([*parts, *(["corner"] if point.get("corner") else [])])


def summary(points: Sequence[Mapping[str, Any]], parameters: Sequence[str]) -> Rows:
    """Many points in a few lines: how many are certified, between what, and where there are none."""
    proved = [point["certified"] for point in points if "certified" in point]
    absent = [point for point in points if not solvable(point)]
    hidden = sum(not point.get("attained", True) for point in points)
    rows = [("surface", f"{len(points)} points, {between(points, parameters)}: {len(proved)} certified")]
    rows += [("certified", between(proved, (*QUANTITIES, "L")))] if proved else []
    rows += [("not attained", f"at {hidden} of them")] if hidden else []
    return rows + ([("no solution", f"at {len(absent)} of them, {between(absent, parameters)}")] if absent else [])


def between(points: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> str:
    """Ranges of what points hold."""
    columns = {key: [point[key] for point in points if key in point] for key in keys}
    return ", ".join(f"{label(key)} {span(key, min(c), max(c))}" for key, c in columns.items() if c)


def span(key: str, low: float, high: float) -> str:
    """Range in words."""
    ends = [SAFE[key](end, 4) if key in SAFE else f"{end:.4g}" for end in (low, high)]
    return " to ".join(ends if low < high else ends[:1])


def solvable(point: Mapping[str, Any]) -> bool:
    """Whether a point has a limit: of what has no weight in it there is none."""
    return any(key in point for key in QUANTITIES)


def certified(numbers: Mapping[str, float]) -> str:
    """What a gain is proved to achieve, and its size."""
    proved = ", ".join(f"{key} {safe(numbers[key])}" for key, safe in SAFE.items() if key in numbers)
    return f"{proved}, {size_text(numbers)}"


def size_text(numbers: Mapping[str, float]) -> str:
    """Size of a gain: of L or L1, or of K where the observer is reset."""
    name = next((name for name in ("K", "L1") if name in numbers), "L")
    return f"|{name}| = {numbers[name]:.4g}"


def quantities(numbers: Mapping[str, float]) -> str:
    """Lipschitz constant and gamma, whichever there are."""
    return ", ".join(f"{key} {numbers[key]:.6g}" for key in QUANTITIES if key in numbers)


def label(key: str) -> str:
    """Name of a quantity in a table."""
    return "|L|" if key == "L" else key
