"""Old against new for every shipped spec: `python tests/benchmarks/table.py OLD_CHECKOUT [PATTERN]`.

Whole processes of `obsdesign solve`, with one thread and compiled modules, in pairs: old, new, new, old, .. so that
what else the machine does meets both alike. Printed for each spec: the least processor time of either, and the ratio.
Ends with 1 where one is slower than 1.1 times; such a spec is measured in as many pairs once more before.
"""

import argparse
import compileall
import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
SLOWER = 1.1


def seconds(checkout, spec, folder):
    """Processor time of one process, of a checkout, with the exit code."""
    code = "from obsdesign.__main__ import main; main()"
    command = [sys.executable, "-P", "-c", code, "solve", str(spec), "-q", "-o", f"{folder}/gains.json"]
    env = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    env.pop("PYTHONDONTWRITEBYTECODE", None)
    silent = [(os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)]
    _, status, used = os.wait4(os.posix_spawn(sys.executable, command, env, file_actions=silent), 0)
    return used.ru_utime + used.ru_stime, os.waitstatus_to_exitcode(status)


def pairs(checkouts, spec, count, folder):
    """Least times of both checkouts, and their exit codes."""
    times, codes = ([], []), [None, None]
    for k in range(count):
        for which in (0, 1) if k % 2 == 0 else (1, 0):
            taken, codes[which] = seconds(checkouts[which], spec, folder)
            times[which].append(taken)
    return min(times[0]), min(times[1]), codes


def row(checkouts, spec, count, folder):
    """Old, new, and the ratio of a spec; measured again where it seems to be slower."""
    old, new, codes = pairs(checkouts, spec, count, folder)
    if new > SLOWER * old:
        again = pairs(checkouts, spec, 2 * count, folder)
        old, new = min(old, again[0]), min(new, again[1])
    note = "" if codes[0] == codes[1] else f"  exit {codes[0]} -> {codes[1]}"
    name = spec.relative_to(ROOT / "specs").with_suffix("")
    print(f"{name!s:52} {old:8.3f} {new:8.3f} {new / old:6.2f}{note}", flush=True)
    return old, new


def main():
    """Measure all specs that both checkouts have; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", type=Path, metavar="OLD_CHECKOUT")
    parser.add_argument("pattern", nargs="?", default="*", help="of the names of specs")
    parser.add_argument("--pairs", type=int, default=2)
    asked = parser.parse_args()
    checkouts = (asked.old.resolve(), ROOT)
    for checkout in checkouts:
        compileall.compile_dir(checkout / "obsdesign", quiet=1)
    specs = sorted((ROOT / "specs").rglob(f"{asked.pattern}.yaml"))
    specs = [spec for spec in specs if (asked.old / spec.relative_to(ROOT)).exists()]
    print(f"{'spec':52} {'old, s':>8} {'new, s':>8} {'ratio':>6}")
    with tempfile.TemporaryDirectory() as folder:
        rows = [row(checkouts, spec, asked.pairs, folder) for spec in specs]
    old, new = (sum(times) for times in zip(*rows, strict=True))
    slower = sum(new > SLOWER * old for old, new in rows)
    print(f"{f'all {len(rows)}':52} {old:8.3f} {new:8.3f} {new / old:6.2f}")
    print(f"slower than {SLOWER} times: {slower}")
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
