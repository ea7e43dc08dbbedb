"""`obsdesign simulate --runs N`: many runs, each with its own seed."""

import os
from collections.abc import Sequence

from obsdesign.cli.sources import Answer
from obsdesign.cli.steps import as_text, failing, interruptible, progress, stem, taken
from obsdesign.errors import UsageError
from obsdesign.records import dataclass

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Options:
    """Of `simulate`, as they are for many runs."""

    runs: int
    jobs: int  # 0: one a core
    gains: str
    labelled: bool
    changes: Sequence[str]
    output: str
    plot: str
    solver: str
    as_json: bool
    quiet: bool


def require_many(runs: int | None, jobs: int | None, plot: str, plot_all: bool) -> None:
    """Refuse options that go with many runs, or with one, and a figure to be printed; raises `UsageError`."""
    if plot == "-":
        raise UsageError("--plot -: a figure is not printed; name a file", id="OBS904")
    if runs is None and jobs is not None:
        raise UsageError("--jobs goes with --runs N: one run has one process", id="OBS904")
    if runs is not None and plot_all:
        raise UsageError("--plot-all is of one run: leave it out, or leave --runs out", id="OBS904")


def many(source: str, asked: Options) -> Answer:
    """Answer of `simulate --runs`: the envelope of the runs and its figure, written when all is done, and a summary."""
    from obsdesign.disk import require_two, require_writable, write_all

    os.environ.update(dict.fromkeys(THREADS, "1"))  # of numpy, which is not imported yet: each process has one
    name = stem(source)
    paths = asked.output or f"{name}.runs.csv", asked.plot or f"{name}.runs.png"
    require_two(*paths, "envelope and figure")
    kinds = dict(zip(paths, ("envelopes", "figures"), strict=True))
    kept = require_writable(kinds, read=[source, *[asked.gains] * bool(asked.gains)])
    problem = taken(source, () if asked.gains and not asked.labelled else asked.changes)
    from obsdesign import work
    from obsdesign.files import csv
    from obsdesign.plot import form_of
    from obsdesign.plot.envelope import envelope_figure
    from obsdesign.simulate.recorded import followed
    from obsdesign.simulate.tally import require_all_kept
    from obsdesign.tables.montecarlo import montecarlo_table

    with progress(asked.quiet) as report:
        design = work.trial(problem, asked.gains, asked.solver, report, asked.changes, labelled=asked.labelled)
    require_writable(kinds, read=followed(design.elsewhere or design.spec))
    with interruptible(lambda: "no envelope and no figure are written"), progress(asked.quiet) as report:
        jobs = asked.jobs or len(os.sched_getaffinity(0))
        found = design.montecarlo(asked.runs, jobs, lambda done: report(done, f"{asked.runs} runs"))
    envelope, figure = csv(*found.table()), envelope_figure(found, form=form_of(paths[1]))
    write_all({path: made for path, made in zip(paths, (envelope, figure), strict=True) if path != "-"})
    if paths[0] == "-":
        return Answer(envelope.decode())
    files = kept[paths[0]], kept[paths[1]]
    text = as_text(found.report) if asked.as_json else "" if asked.quiet else montecarlo_table(found.report, files)
    return Answer(text, failure=failing(lambda: require_all_kept(found, paths[0])))
