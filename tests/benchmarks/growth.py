"""Processor time of a design against the number of states: `python tests/benchmarks/growth.py growth.png`.

Each plant (chain, rod, beam: see tests/support/rods.py) is designed in a process of its own with one thread; what is
measured is the processor time of the design and its proof, without the imports. Beside it stands the plain LMI of the
same l2 problem, built in cvxpy and solved by Clarabel, which only finds the limit, up to 24 states. A design that takes
longer than the limit of time is left out, as are larger ones of that plant.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
PLANTS = ("chain", "heat", "beam")
SIZES = (8, 12, 16, 24, 32, 64, 128)
LARGEST_IN_CVXPY = 24
OURS, THEIRS = "obsdesign", "cvxpy + Clarabel"


def designed(spec):
    """Limit and shipped gamma of a spec, proved."""
    from obsdesign.work import solve

    design = solve(spec)
    assert design.status == "certified", design.status
    return design.limit["gamma"]


def rebuilt(spec):
    """Least gamma of the same inequality, as a modelling language takes it: V' + 2 alpha V + |z|^2 <= gamma^2 |w|^2."""
    import cvxpy as cp
    import numpy as np

    from obsdesign.lmi.formula import rational

    p, H = (spec.augmented, spec.H)
    A, Bf, B, Cq, C, D, H = (np.asarray(X, dtype=float) for X in (p.A, p.Bf, p.B, p.Cq, p.C, p.D, H))
    n, nf, nw = len(A), Bf.shape[1], B.shape[1]
    alpha = float(spec.observer.rate)
    P, Y = cp.Variable((n, n), symmetric=True), cp.Variable((n, len(C)))
    names = [unknown.name for unknown in spec.multiplier.unknowns()]
    scales, mu = cp.Variable(len(names), nonneg=True), cp.Variable()
    alone = [{name: rational([[int(name == this)]]) for name in names} for this in names]
    parts = [[np.asarray(M, dtype=float) for M in spec.multiplier.matrix(values)] for values in alone]
    qq, qf, ff = (sum(scale * M[k] for scale, M in zip(scales, parts, strict=True)) for k in range(3))
    e = P @ A + A.T @ P + Y @ C + C.T @ Y.T + 2 * alpha * P + H.T @ H + Cq.T @ qq @ Cq
    ef, ew = P @ Bf + Cq.T @ qf, -(P @ B + Y @ D)
    none = np.zeros((nf, nw))
    whole = cp.bmat([[e, ef, ew], [ef.T, ff, none], [ew.T, none.T, -mu * np.eye(nw)]])
    cp.Problem(cp.Minimize(mu), [(whole + whole.T) / 2 << 0, P >> 0]).solve(solver="CLARABEL")
    return float(np.sqrt(mu.value))


def one(plant, n, tool):
    """Processor time (s) and limit of one plant, in this process; a small one goes before it, for what is imported."""
    sys.path.insert(0, str(HERE.parent))
    import warnings

    warnings.simplefilter("ignore")  # cvxpy says that some of these optima are inaccurate
    from support import rods
    from support.speed import processor_time

    from obsdesign.reading import loads

    run = {OURS: designed, THEIRS: rebuilt}[tool]
    run(loads(rods.beam(8)))
    seconds, gamma = processor_time(lambda: run(loads(getattr(rods, plant)(n))))
    print(json.dumps({"seconds": seconds, "gamma": gamma}))


def measured(plant, n, tool, limit):
    """What a process of its own measures; None where it takes too long, or fails."""
    command = [sys.executable, __file__, "--one", plant, str(n), tool]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=True)
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError):
        return None
    return json.loads(done.stdout)


def curves(sizes, limit):
    """Times by tool and plant, {(tool, plant): {n: s}}, printed as they come."""
    found = {}
    for tool in (OURS, THEIRS):
        for plant in PLANTS:
            for n in sizes if tool == OURS else [n for n in sizes if n <= LARGEST_IN_CVXPY]:
                row = measured(plant, n, tool, limit)
                if row is None:
                    print(f"{tool:17} {plant:6} {n:4}  longer than {limit:g} s", flush=True)
                    break
                print(f"{tool:17} {plant:6} {n:4} {row['seconds']:9.3f} s  gamma {row['gamma']:.6g}", flush=True)
                found.setdefault((tool, plant), {})[n] = row["seconds"]
    return found


def drawn(found, path):
    """Figure of the curves, both axes logarithmic."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
    for (tool, plant), times in found.items():
        mark = {"chain": "o", "heat": "s", "beam": "^"}[plant]
        line, color = ("-", "tab:blue") if tool == OURS else ("--", "tab:red")
        axes.loglog(*zip(*sorted(times.items()), strict=True), line, marker=mark, color=color, label=f"{tool}, {plant}")
    ticks = sorted({n for times in found.values() for n in times})
    axes.set_xticks(ticks, list(map(str, ticks)))
    axes.minorticks_off()
    axes.set(xlabel="states n", ylabel="processor time of a design, s", title="Least gamma (l2), one thread")
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)


def main():
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("figure", nargs="?", default="growth.png")
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--limit", type=float, default=120.0, metavar="SECONDS", help="wall clock of one design")
    parser.add_argument("--one", nargs=3, metavar=("PLANT", "N", "TOOL"), help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.one:
        plant, n, tool = asked.one
        one(plant, int(n), tool)
    else:
        drawn(curves(asked.sizes, asked.limit), asked.figure)


if __name__ == "__main__":
    main()
