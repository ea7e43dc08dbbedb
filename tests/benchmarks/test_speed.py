"""Speed, as ratios within one run: `pytest tests/benchmarks --benchmark-only`.

Times are processor times, so that another process on the machine does not count.
"""

import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.speed import child_time, compared, processor_time, slowness

from obsdesign.dissipation.gain import searchable
from obsdesign.families.incremental.theorems import L2
from obsdesign.lmi.reduce import between
from obsdesign.lmi.solve import minimise, reduction
from obsdesign.reading import load, loads
from obsdesign.work import solve, verify

SPECS = Path(__file__).parents[2] / "specs"
BEARING = SPECS / "corless2019-magnetic-bearing.yaml"
CURVE = SPECS / "corless2019-magnetic-bearing-tradeoff.yaml"
ALPHAS = np.geomspace(0.1, 5, 25)


@pytest.fixture(scope="module")
def bearing():
    spec = load(str(BEARING))
    return searchable(L2(spec.augmented, spec.multiplier, spec.H, spec.observer.rate, None, spec.observer.L2))


def curve(family):
    """Least gamma^2 on a grid of alpha, as `solve` computes it."""
    low = reduction(replace(family, rate=ALPHAS[0]).least_gamma())
    high = reduction(replace(family, rate=ALPHAS[-1]).least_gamma(), low)
    start, found = None, []
    for alpha in ALPHAS:
        weight = (alpha - ALPHAS[0]) / (ALPHAS[-1] - ALPHAS[0])
        answer = minimise(replace(family, rate=alpha).least_gamma(), start=start, reduced=between(low, high, weight))
        start = answer.values
        found.append(answer.objective)
    return found


def rebuilt_in_cvxpy(family, alpha):
    """The same problem as a modelling language takes it: row f as an equality, rebuilt for every alpha."""
    import cvxpy as cp

    p, n, ny = family.plant, family.plant.n, len(family.plant.C)
    P, Y = cp.Variable((n, n), symmetric=True), cp.Variable((n, ny))
    scale, mu2 = cp.Variable(nonneg=True), cp.Variable()
    e = P @ p.A + p.A.T @ P + Y @ p.C + p.C.T @ Y.T + 2 * alpha * P + family.H.T @ family.H
    v = -(P @ p.B + Y @ p.D)
    tied = P @ p.Bf + scale * (p.Cq + family.L2 @ p.C).T == 0
    problem = cp.Problem(cp.Minimize(mu2), [cp.bmat([[e, v], [v.T, -mu2 * np.eye(p.B.shape[1])]]) << 0, P >> 0, tied])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # cvxpy warns that some of these optima are inaccurate
        problem.solve(solver="CLARABEL")
    return problem.value


def test_each_alpha_of_a_curve_is_five_times_faster_than_cvxpy_rebuilt(benchmark, bearing):
    curve(bearing), rebuilt_in_cvxpy(bearing, 1.0)  # imports
    ours = benchmark.pedantic(lambda: processor_time(lambda: curve(bearing)), rounds=1)
    theirs = processor_time(lambda: [rebuilt_in_cvxpy(bearing, alpha) for alpha in ALPHAS])
    np.testing.assert_allclose(theirs[1], ours[1], rtol=2e-3)
    ratio = theirs[0] / min(ours[0], *(processor_time(lambda: curve(bearing))[0] for _ in range(2)))
    benchmark.extra_info["times faster than cvxpy rebuilt"] = round(ratio, 1)
    assert ratio >= 5


def test_a_whole_solve_with_a_curve_of_25_points_takes_little_processor_time(benchmark, tmp_path):
    program = str(Path(sys.executable).with_name("obsdesign"))
    target = str(tmp_path / "gains.json")
    seconds = benchmark.pedantic(lambda: child_time(program, "solve", str(CURVE), "-q", "-o", target), rounds=1)
    benchmark.extra_info["processor time [s]"] = seconds
    assert seconds < 1.2 * slowness()


CONTINUOUS = """
obsdesign: 1
system: {A: [[-1, 1, 0], [-1, -2, 2], [0, -2, -3]], C: [1, 0, 0], B: [[1, 0], [0, 0], [2, 0]], D: [0, 0.1]}
nonlinearities:
  - {type: {slope: [0, 1]}, Bf: [0, 2, 0], Cq: [0, 1, 0]}
  - {type: {lipschitz: 0.5}, Bf: [0, 0, 3], Cq: [0, 0, 1]}
observer: {type: l2, L2: 0, alpha: 0.5, bounds: {L1: 100}}
"""


def test_a_design_in_discrete_time_costs_no_more_than_1_3_times_as_much(benchmark):
    plants = CONTINUOUS, CONTINUOUS.replace("system: {", "system: {discretise: {period: 0.1}, ")
    continuous, discrete = map(loads, plants)
    assert [solve(spec).status for spec in (continuous, discrete)] == ["certified", "certified"]
    times = benchmark.pedantic(lambda: compared(lambda: solve(discrete), lambda: solve(continuous)), rounds=1)
    ratio = times[0] / times[1]
    benchmark.extra_info["times a continuous design"] = round(ratio, 2)
    assert ratio <= 1.3


def test_help_starts_fast(benchmark):
    program = str(Path(sys.executable).with_name("obsdesign"))
    seconds = benchmark.pedantic(lambda: child_time(program, "--help"), rounds=1)
    benchmark.extra_info["processor time [s]"] = seconds
    assert seconds < 0.25 * slowness()


def test_a_typing_error_is_told_within_300_ms(benchmark, tmp_path):
    (tmp_path / "spec.yaml").write_text("obsdesign: 1\nname: [x\n")
    program = Path(sys.executable).with_name("obsdesign")
    told = f"! {program} check {tmp_path}/spec.yaml 2>&1 | grep -v OBS104"  # nothing but that
    seconds = benchmark.pedantic(lambda: child_time("sh", "-c", told), rounds=1)
    benchmark.extra_info["processor time [s]"] = seconds
    assert seconds < 0.3 * slowness()


def test_the_import_takes_less_than_30_ms(benchmark):
    bare = child_time(sys.executable, "-c", "pass")
    seconds = benchmark.pedantic(lambda: child_time(sys.executable, "-c", "import obsdesign") - bare, rounds=1)
    benchmark.extra_info["processor time [s]"] = seconds
    assert seconds < 0.03 * slowness()


def test_a_spec_is_read_within_30_ms(benchmark):
    load(str(BEARING))
    seconds = benchmark.pedantic(lambda: processor_time(lambda: load(str(BEARING)))[0], rounds=5)
    assert seconds < 0.03 * slowness()


def test_a_spec_of_256_states_is_read_within_300_ms(benchmark):
    A, B, C, D = (np.round(X, 6).tolist() for X in random_entries(256))
    text = f"obsdesign: 1\nsystem:\n  A: {A}\n  B: {B}\n  C: {C}\n  D: {D}\nobserver: {{type: l2, alpha: 0.1}}\n"
    assert len(text) > 6e5
    loads(text)
    seconds = benchmark.pedantic(lambda: min(processor_time(lambda: loads(text))[0] for _ in range(3)), rounds=1)
    assert seconds < 0.3 * slowness()


def random_entries(n):
    """Matrices of n states in which no entry is zero."""
    rng = np.random.default_rng(0)
    return tuple(rng.uniform(0.1, 1, shape) for shape in ((n, n), (n, 3), (2, n), (2, 3)))


def test_a_proof_of_order_8_takes_less_than_50_ms(benchmark, tmp_path):
    spec = load(str(BEARING))
    path = tmp_path / "gains.json"
    solve(spec).save(path)
    verify(str(path))
    seconds = benchmark.pedantic(lambda: processor_time(lambda: verify(str(path)))[0], rounds=5)
    assert seconds < 0.05 * slowness()
