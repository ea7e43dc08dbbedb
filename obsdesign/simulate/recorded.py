"""Signals of a run that are in files: where the files are, what is read of them, and what they are at an instant.

Between two rows at t_k and t_k+1 a signal is u_k (hold zero), or u_k + (u_k+1 - u_k)/(t_k+1 - t_k) (t - t_k) (first).
At the instant of a row it is that of the row. It is defined from the first row on, and until after the last one as much
time has gone by as between the last two, in which it stays as it is.
"""

import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.files.table import Table, filled, not_rising
from obsdesign.lmi.formula import Array, Float
from obsdesign.model.ahead import ahead
from obsdesign.records import dataclass, replace
from obsdesign.sections.source import text_of
from obsdesign.spec import Spec
from obsdesign.trial import Column, Simulation

LARGEST = 256 * 2**20  # bytes of a file
MOST = 1_000_000  # rows within a run
ROUNDING = 1e-9  # of the horizon: how far the first and last rows may be off
APART = 0.01  # of a period: how far rows that are held may be after the samples of a plant


@dataclass(frozen=True)
class Track:
    """A signal, row by row, known from the first row to the last."""

    variable: str
    t: Float  # (K,), s, rising
    values: Float  # (K,)
    first: bool  # whether it is on a line between two rows
    early: float = 0.0  # s: how much before its row a sample takes it, where it is held

    @cached_property
    def slopes(self) -> Float:
        """Rate after each row, (K,); the last value stays."""
        if not self.first:
            return np.zeros(len(self.t))
        return np.append(np.diff(self.values) / np.diff(self.t), 0.0)

    def row(self, t: float | Float) -> Array:
        """Number of the row that an instant, or each of several, is at or after."""
        return np.asarray(np.clip(np.searchsorted(self.t, np.asarray(t) + self.early, side="right") - 1, 0, None))

    def at(self, t: float | Float) -> Float:
        """Value at an instant, or at each of several."""
        k = self.row(t)
        return np.asarray(self.values[k] + self.slopes[k] * np.maximum(t - self.t[k], 0.0))

    def rate(self, t: float | Float) -> Float:
        """Slope after an instant, or after each of several."""
        return np.asarray(self.slopes[self.row(t)])

    @property
    def turns(self) -> Float:
        """Instants of the rows at which it jumps, or bends."""
        moves = np.diff(self.slopes) != 0 if self.first else np.diff(self.values) != 0
        return np.asarray(self.t[1:][moves])


@dataclass(frozen=True)
class Recordings:
    """All signals of a run that are in files, as inputs of a program that are constant between two rows.

    In continuous time one that is on lines has three: the value at the row, the slope, and the instant of the row. In
    samples each has its value at the sample, and that at the next.
    """

    tracks: tuple[Track, ...] = ()
    sampled: float | None = None  # s, the period of a plant in samples

    @property
    def variables(self) -> tuple[str, ...]:
        """Names by which expressions call them."""
        return tuple(track.variable for track in self.tracks)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs of a program."""
        if self.sampled is not None:
            return (*self.variables, *map(ahead, self.variables))
        lines = ((f"{name} at its row", f"{name} slope", f"{name} since") for name in self.on_lines)
        return (
            *(track.variable for track in self.tracks if not track.first),
            *(name for line in lines for name in line),
        )

    @property
    def on_lines(self) -> tuple[str, ...]:
        """Variables of the signals that are no inputs themselves."""
        return tuple(track.variable for track in self.tracks if track.first) if self.sampled is None else ()

    @property
    def definitions(self) -> dict[str, Expression]:
        """Signals on lines in these inputs, by their variables."""
        made = {}
        for name in self.on_lines:
            value, slope, since = (Expression.variable(f"{name} {what}") for what in ("at its row", "slope", "since"))
            made[name] = value + slope * (Expression.variable("t") - since)
        return made

    def held(self, t: float | Float) -> Float:
        """Inputs around an instant, (m,), or around each of several (N,), (N, m)."""
        t = np.asarray(t, dtype=float)
        if self.sampled is not None:
            columns = [track.at(t + k * self.sampled) for k in (0, 1) for track in self.tracks]
        else:
            columns = [track.at(t) for track in self.tracks if not track.first]
            for track in self.tracks:
                if track.first:
                    k = track.row(t)
                    columns += [track.values[k], track.slopes[k], track.t[k]]
        return np.stack(columns, axis=-1) if columns else np.zeros((*t.shape, 0))

    def at(self, t: float | Float) -> Mapping[str, Float]:
        """Values at an instant, or at each of several, by variable."""
        return {track.variable: track.at(t) for track in self.tracks}

    def rate(self, signal: Expression, t: Float) -> Float | None:
        """Slope of a signal that is in a file, after each instant; None of another one."""
        return next((track.rate(t) for track in self.tracks if track.variable == signal.text), None)

    def edges(self, end: float) -> list[tuple[float, float]]:
        """Instants in (0, end) at which one jumps or bends: the last double before, the row."""
        if not self.tracks:
            return []
        t = np.unique(np.concatenate([track.turns for track in self.tracks]))
        t = t[(t > 0) & (t < end)]
        return list(zip(np.nextafter(t, -np.inf).tolist(), t.tolist(), strict=True))


def recordings(spec: Spec, simulation: Simulation) -> Recordings:
    """Signals of a run that are in files, read as far as the run goes.

    Raises `UsageError`: a file is missing, too large, not one of columns, or does not cover the run.
    """
    if not simulation.recorded:
        return Recordings()
    groups: dict[tuple[str, str], list[Column]] = {}
    for column in simulation.recorded.values():
        groups.setdefault((place(spec, column), column.time), []).append(column)
    tracks = {
        track.variable: track for key, columns in groups.items() for track in tracks_of(spec, simulation, *key, columns)
    }
    sampled = None if spec.period is None else float(spec.period)
    return Recordings(tuple(tracks[name] for name in simulation.recorded), sampled)


def tracks_of(spec: Spec, simulation: Simulation, path: str, time: str, columns: Sequence[Column]) -> Iterator[Track]:
    """Signals that are in one file."""
    table, period = Table(path), float(spec.period) if spec.period is not None else 0.0
    places = [table.column(time), *(table.column(one.column) for one in columns)]
    for name, i in zip(("time", *(one.name for one in columns)), places, strict=True):
        unit, head = spec.units.get(name, ""), table.columns[i]
        if head.differs(unit, time=i == places[0]):
            said = f"column {head.text} is in {head.unit}, and {name} in {'s' if i == places[0] else unit}"
            raise table.wrong(f"{said}; write it in this unit", table.heading, id="OBS811")
    rows = rows_of(table, places, simulation.horizon + period)
    require_covered(columns[0], rows[:, 0], simulation.horizon, path)
    for values, one in zip(rows.T[1:], columns, strict=True):
        first = one.hold == "first"
        yield Track(one.variable, rows[:, 0], values, first, 0.0 if first else APART * period)


def rows_of(table: Table, places: Sequence[int], end: float) -> Float:
    """Times and values (K, 1 + m), up to the first row at or after the end; what is missing is as in the row before.

    Raises `UsageError`: times do not rise, a first value is missing, or there are too many rows.
    """
    parts, count, before = list[Float](), 0, np.full(len(places), np.nan)
    for block in table.finite(places):
        t = block.rows[:, 0]
        last = before[0] if count else -np.inf
        if len(wrong := np.flatnonzero(~(np.diff(t, prepend=last) > 0))):
            k = int(wrong[0])
            said = not_rising(t[k], t[k - 1] if k else last)
            raise table.wrong(f"{said}; sort the rows, each with a time of its own", int(block.lines[k]), id="OBS811")
        rows = filled(block.rows, before)
        if np.isnan(rows).any():
            k, i = np.argwhere(np.isnan(rows))[0]
            said = f"{table.columns[places[i]].text}: the first value is missing; begin where it is known"
            raise table.wrong(said, int(block.lines[k]), id="OBS811")
        kept = int(np.searchsorted(t, end)) + 1
        parts.append(rows[:kept])
        count += len(parts[-1])
        if count > MOST:
            raise UsageError(Problem(f"more than {MOST:,} rows within the horizon", table.path, id="OBS210"))
        if kept <= len(t):
            break
        before = rows[-1] if len(rows) else before
    return np.concatenate(parts) if parts else np.zeros((0, len(places)))


def require_covered(column: Column, t: Float, horizon: float, path: str) -> None:
    """Refuse a file that begins after the run, or ends before it; raises `UsageError`."""
    slack = ROUNDING * horizon
    if not len(t):
        said = "has no rows; a run needs them from t = 0 to the horizon"
    elif t[0] > slack:
        said = f"begins at t = {t[0]:.9g} s, and the run at t = 0; give it a row there"
    elif (end := t[-1] + (t[-1] - t[-2] if len(t) > 1 else 0.0)) < horizon - slack:
        said = f"ends at t = {end:.9g} s, before the horizon, {horizon:g} s; give more rows, or a shorter horizon"
    else:
        return
    raise UsageError(Problem(f"{path} {said}", key=column.key, id="OBS814"))


def place(spec: Spec, column: Column) -> str:
    """Path of the file of a column: below the folder of the spec, or, where the spec came in a result, of that one.

    Raises `UsageError`: there is none, it is no regular file, a link leads out of the folder, or it is too large.
    """
    if column.path:
        return column.path
    looked = places(spec, column)
    for path, folder in looked.items():
        if os.path.lexists(path):
            require_own(column, folder, path)
            return path
    said = f"{column.file} is not there: looked for {' and '.join(looked)}"
    if spec.origin and not is_still(spec):
        said += f"; the spec of these gains, {spec.origin}, is not there as it was"
    raise UsageError(Problem(said, key=column.key, id="OBS101"))


def places(spec: Spec, column: Column) -> dict[str, str]:
    """Paths at which the file of a column may be, each with the folder that it is below."""
    return {os.path.join(folder, column.file): folder for folder in folders(spec)}


def absent(spec: Spec) -> list[str]:
    """Files that a run of a spec follows and that are not there, as they are named."""
    columns = spec.simulation.recorded.values() if spec.simulation else ()
    found = [
        one.file for one in columns if not any(map(os.path.lexists, [one.path] if one.path else places(spec, one)))
    ]
    return list(dict.fromkeys(found))


def followed(spec: Spec) -> list[str]:
    """Paths of the files that a run follows, as far as they can be read: no result may take their place."""
    found = []
    for column in spec.simulation.recorded.values() if spec.simulation else ():
        with suppress(UsageError):
            found.append(place(spec, column))
    return found


def folders(spec: Spec) -> list[str]:
    """Folders below which the files of a spec may be: of a spec from a result, where that says it was, if it still is.

    A result may come from anyone, so that what it says of a path counts only where the same spec stands there.
    """
    return [os.path.dirname(path) for path in ((spec.origin, spec.path) if is_still(spec) else (spec.path,))]


def is_still(spec: Spec) -> bool:
    """Whether a spec from a result stands where that says it was, as it was."""
    try:
        return os.path.isfile(spec.origin) and text_of(spec.origin) == spec.text
    except UsageError:
        return False


def require_own(column: Column, folder: str, path: str) -> None:
    """Refuse what is no file of a fitting size below a folder, all links followed; raises `UsageError`."""
    try:
        below = Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder or "."))
        found = os.stat(path)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise UsageError(Problem(f"{path} cannot be read: {reason}", key=column.key, id="OBS101")) from None
    if not below:
        said = f"{path} leads out of the folder {folder or '.'}; a file of signals lies below that of its spec"
        raise UsageError(Problem(said, key=column.key, id="OBS216"))
    if not stat.S_ISREG(found.st_mode):
        raise UsageError(Problem(f"{path} is no regular file; give a file of columns", key=column.key, id="OBS101"))
    if found.st_size > LARGEST:
        said = f"{path} has {found.st_size:,} bytes; at most {LARGEST:,} are read: cut it to the horizon"
        raise UsageError(Problem(said, key=column.key, id="OBS210"))


def with_paths(spec: Spec) -> Spec:
    """Spec whose recorded signals have the paths of their files, wherever its simulation goes. Raises as `place`."""
    simulation = spec.simulation
    assert simulation
    paths = {name: replace(one, path=place(spec, one)) for name, one in simulation.recorded.items()}
    return replace(spec, simulation=replace(simulation, recorded=paths))
