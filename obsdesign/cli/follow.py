"""A batch as it goes on, on standard error: a live table with a bar on a terminal, plain lines elsewhere."""

import sys
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from obsdesign.cli.printing import say
from obsdesign.disk import remove_earlier
from obsdesign.watch import orderly

if TYPE_CHECKING:
    from rich.console import RenderableType

    from obsdesign.batches import Follower

RECENT = 5  # specs that ended last, in the live table
RATE = 4.0  # redrawings a second


class Lines:
    """A line for each spec as it ends; what is up to date is told with -v only."""

    def __init__(self, quiet: bool, verbose: bool, earlier: str) -> None:
        self.quiet, self.verbose, self.earlier = quiet, verbose, earlier
        self.total = self.done = 0

    def found(self, total: int) -> None:
        """So many specs are to be run or are up to date; what an earlier batch left for other programs is removed."""
        self.total = total
        remove_earlier(self.earlier)

    def begun(self, title: str) -> None:
        """Nothing is said of a beginning."""

    def ended(self, entry: dict[str, Any]) -> None:
        """One has ended, or is up to date."""
        from obsdesign.batches.table import complaints, line, shown

        self.done += 1
        if not self.quiet and (self.verbose or not entry["up_to_date"]):
            why = f"  ({shown(entry['why'])})" if self.verbose and entry["why"] else ""
            self.say(f"[{self.done:{len(str(self.total))}}/{self.total}]  {line(entry)}{why}")
        for complaint in complaints(entry):
            self.say(complaint)

    def say(self, line: str) -> None:
        """One line."""
        say(line, err=True)


class Live(Lines):
    """What is under way and what ended last, above a bar; what is not as expected stays above it."""

    def __init__(self, quiet: bool, verbose: bool, earlier: str) -> None:
        from rich.console import Console
        from rich.live import Live

        super().__init__(quiet, verbose, earlier)
        self.running, self.recent = dict[str, float](), deque[str](maxlen=RECENT)
        self.counts: Counter[str] = Counter()
        console = Console(stderr=True, highlight=False, markup=False, emoji=False)
        self.live = Live(get_renderable=self.view, console=console, refresh_per_second=RATE, transient=True)

    def begun(self, title: str) -> None:
        """One is under way."""
        self.running[title] = time.monotonic()

    def ended(self, entry: dict[str, Any]) -> None:
        """One has ended, or is up to date."""
        from obsdesign.batches.find import titled
        from obsdesign.batches.table import line

        self.running.pop(titled(entry["path"], entry["set"]), None)
        self.counts[entry["status"]] += 1
        self.recent.append(line(entry))
        if self.verbose or entry["as_expected"] is False:
            super().ended(entry)
        else:
            self.done += 1

    def say(self, line: str) -> None:
        """One line, above the table."""
        self.live.console.print(line, soft_wrap=True)

    def view(self) -> "RenderableType":
        """The table, as it is now."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        from obsdesign.batches.table import shown

        now, table = time.monotonic(), Table.grid(padding=(0, 2))
        for line in self.recent:
            table.add_row("", Text(line, style="dim", no_wrap=True, overflow="ellipsis"))
        for title, begun in list(self.running.items()):
            text = Text(shown(title), no_wrap=True, overflow="ellipsis")
            table.add_row(Text(f"{now - begun:6.1f} s", style="cyan"), text)
        kinds = ", ".join(f"{count} {status}" for status, count in sorted(self.counts.items()))
        bar = Table.grid(padding=(0, 1))
        bar.add_row(ProgressBar(max(self.total, 1), self.done, width=40), f"{self.done}/{self.total}", Text(kinds))
        return Group(table, bar)


@contextmanager
def followed(quiet: bool, verbose: bool, earlier: str) -> Iterator["Follower"]:
    """Who tells how a batch goes on, which ends in order where it is interrupted; `earlier`: see `Lines.found`."""
    orderly()
    if quiet or not sys.stderr.isatty():
        yield Lines(quiet, verbose, earlier)
        return
    follower = Live(quiet, verbose, earlier)
    with follower.live:
        yield follower
