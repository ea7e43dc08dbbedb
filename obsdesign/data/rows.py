"""Rows of a log, and those of an observer that uses them when they arrive."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from obsdesign.lmi.formula import Array, Float

MOST_HELD = 1_000_000  # samples at which no row is new, between two


class Rows(NamedTuple):
    """Some rows of a log, in the order in which they are known."""

    t: Float  # (K,), s
    u: Float  # (K, nu); what is missing is as it was in the row before
    y: Float  # (K, ny); NaN where it is missing
    known: Float  # (K,), s: when each row is known; t where the log says nothing of it
    lines: Array  # (K,), of the file
    guessed: Array  # (K,), whether some of u was missing
    truth: Float  # (K, m), of what is known of the plant beside u and y; NaN where it is missing
    held: Array  # (K,), whether nothing new is used here: u and y are those that hold then
    unused: Array  # (K,), how many rows are not used up to here, for newer ones came before

    def cut(self, begin: int, end: int | None = None) -> "Rows":
        """Rows from one on, up to another."""
        return Rows(*(part[begin:end] for part in self))


def newest(blocks: Iterator[Rows], first: bool) -> Iterator[Rows]:
    """Rows that are used when they arrive: one that was made before a newer one has the u and y that hold then.

    `first`: these go on straight lines from one row that is used to the next, so that others wait for that.
    """
    latest, before = -np.inf, list[Rows]()  # time of the newest row; the last that was used, and what waits
    for rows in blocks:
        reached = np.fmax.accumulate(np.concatenate([[latest], rows.t]))
        latest = reached[-1]
        old = rows.t < reached[:-1]
        made = joined([*before, rows._replace(held=old, unused=old.astype(int))])
        place = np.flatnonzero(~made.held)
        end = int(place[-1]) + 1 if first else len(made.t)
        found = standing(part_of(made, 0, end), first)
        yield from nonempty(part_of(found, bool(before), end))
        before = [part_of(found, place[-1], place[-1] + 1), part_of(made, end, len(made.t))]
    if before:
        yield from nonempty(part_of(standing(joined(before), first), 1, None))


def standing(rows: Rows, first: bool) -> Rows:
    """Rows, the first of which is used, with u and y of the others as they hold then."""
    at, K = np.arange(len(rows.t)), len(rows.t)
    place = np.maximum.accumulate(np.where(rows.held, 0, at))
    if not first:
        return rows._replace(t=rows.t[place], u=rows.u[place], y=rows.y[place])
    after = np.minimum.accumulate(np.where(rows.held, K, at)[::-1])[::-1]
    after = np.where(after == K, place, after)
    span = rows.known[after] - rows.known[place]
    share = ((rows.known - rows.known[place]) / np.where(span > 0, span, 1.0))[:, None]
    u, y = (part[place] + np.nan_to_num(share * (part[after] - part[place])) for part in (rows.u, rows.y))
    return rows._replace(t=rows.t[place], u=u, y=y)


def joined(parts: Sequence[Rows]) -> Rows:
    """Rows one after the other."""
    return Rows(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def part_of(rows: Rows, begin: int, end: int | None) -> Rows:
    """Rows from one on, up to another."""
    return Rows(*(column[begin:end] for column in rows))


def nonempty(rows: Rows) -> Iterator[Rows]:
    """Rows, if there are any."""
    if len(rows.t):
        yield rows


def sampled(
    blocks: Iterator[Rows], period: float, apart: float, refuse: Callable[[str, int], Exception]
) -> Iterator[Rows]:
    """One row a sample of a plant, with the newest that is known there; where none is new, the last one holds.

    `period` in s; `apart`: of a period, how far times may be off a sample; `refuse`: error of a line of the file, which
    is raised where a row is not made at a sample, or too many samples have none.
    """
    begin, latest, waiting = np.nan, -np.inf, list[Rows]()  # the first sample; the newest row; of the next sample
    before: tuple[int, Rows] | None = None  # the sample before, and its row
    for rows in blocks:
        begin = float(rows.t[0]) if np.isnan(begin) else begin
        own = (rows.t - begin) / period
        near = (np.abs(own - np.round(own)) <= apart) & (np.abs(own) < 2.0**53)
        if len(wrong := np.flatnonzero(~near)):
            said = f"its time is off its sample; rows of this plant are made {period:g} s apart"
            raise refuse(said, int(rows.lines[wrong[0]]))
        made = joined([*waiting, rows])
        at = samples_of(made, begin, period, apart)
        gaps = np.diff(at, prepend=before[0] if before else at[0])
        if gaps.sum() > MOST_HELD + len(at):
            said = f"the row before is {gaps.max():,} samples earlier"
            raise refuse(said, int(made.lines[int(np.argmax(gaps))]))
        ended = int(np.searchsorted(at, at[-1]))
        waiting = [part_of(made, ended, None)]
        if ended:
            found, latest = at_samples(part_of(made, 0, ended), (begin, period, apart), latest, before, int(at[-1]))
            before = int(at[-1]) - 1, part_of(found, -1, None)
            yield found
    if waiting:
        end = int(samples_of(waiting[0], begin, period, apart)[-1]) + 1
        yield at_samples(waiting[0], (begin, period, apart), latest, before, end)[0]


def samples_of(rows: Rows, begin: float, period: float, apart: float) -> Array:
    """Sample at which each row is known, from 0 at `begin`."""
    return np.asarray(np.ceil((rows.known - begin) / period - apart).astype(int))


def at_samples(
    rows: Rows, clock: tuple[float, float, float], latest: float, before: tuple[int, Rows] | None, end: int
) -> tuple[Rows, float]:
    """Rows of the samples after the one before, up to an end, and the time of the newest row then."""
    at = samples_of(rows, *clock)
    order = np.lexsort((rows.t, at))
    last = np.flatnonzero(np.diff(at[order], append=at[-1] + 1))  # of each sample the newest row
    chosen, sizes = order[last], np.diff(last, prepend=-1)
    reached = np.fmax.accumulate(np.concatenate([[latest], rows.t[chosen]]))
    used = rows.t[chosen] >= reached[:-1]
    begin = before[0] + 1 if before else int(at[0])
    count = end - begin
    new, unused, source = np.zeros(count, dtype=bool), np.zeros(count, dtype=int), np.zeros(count, dtype=int)
    places = at[chosen] - begin
    new[places], unused[places], source[places] = used, sizes - used, chosen + bool(before)
    held = source[np.maximum.accumulate(np.where(new, np.arange(count), 0))]
    source = np.where(np.logical_or.accumulate(new), held, 0)  # 0: the row before
    found = Rows(*(part[source] for part in (joined([before[1], rows]) if before else rows)))
    instants = clock[0] + clock[1] * np.arange(begin, end)
    timely = new & (np.abs(found.t - instants) <= clock[2] * clock[1])
    truth = np.where(new[:, None], found.truth, np.nan)
    known = np.where(timely, found.t, instants)
    return found._replace(known=known, held=~new, unused=unused, truth=truth), float(reached[-1])
