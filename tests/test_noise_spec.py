"""The section `noise:`: channels of w with its number in D, noise of runs that the guarantee covers, refusals."""

import numpy as np
import pytest

import obsdesign as od
from obsdesign.errors import UsageError
from obsdesign.simulate.problem import one_problem

PLANT = {"A": [[0, 1], [-2, -1]], "B": [[0], [1]], "C": [[1, 0]], "outputs": ["y"], "disturbances": ["force"]}
SPRING = [{"type": {"slope": [-0.5, 0.5]}, "f": "0.5*sin(q)", "Bf": [0, -1], "Cq": [1, 0]}]
OBSERVER = {"type": "l2", "alpha": 0.2, "bounds": {"L1": 10}}
HELD = {"y": {"rms": "0.01", "period": 0.002}}
RUN = {"horizon": 4, "w": ["exp(-t)"], "seed": 3}
EQUATIONS = {
    "disturbances": ["torque"],
    "dynamics": {"angle": "speed", "speed": "-atan(speed)*cos(angle) - 0.5*speed + torque"},
    "outputs": {"encoder": "angle"},
    "domain": {"angle": [-1, 1], "speed": [-1, 1]},
}


def spec(**changes):
    usual = {"system": PLANT, "nonlinearities": SPRING, "observer": OBSERVER, "noise": {"y": "0.01"}}
    return od.Spec(**{**usual, **changes})


def problems(**changes):
    with pytest.raises(UsageError) as caught:
        spec(**changes)
    return "; ".join(f"{problem.key}: {problem.message}" for problem in caught.value.problems)


# Channels


def test_noise_is_one_more_channel_whose_number_is_in_D():
    made = spec()
    assert made.plant.exogenous == ("force", "noise_y")
    assert [str(entry) for entry in made.plant.D[0]] == ["0", "1/100"]
    assert not made.plant.B[:, 1].any()


def test_the_design_is_that_of_a_plant_that_has_the_channel_itself():
    own = {**PLANT, "B": [[0, 0], [1, 0]], "D": [[0, 0.01]], "disturbances": ["force", "n"]}
    declared, written = (od.solve(made).result for made in (spec(), spec(system=own, noise={})))
    assert declared["guarantee"]["gamma"] == written["guarantee"]["gamma"]
    assert declared["observer"]["L1"] == written["observer"]["L1"]


@pytest.mark.parametrize("level", [{"rms": "0.01", "period": 1}, {"density": "0.01"}, "0.01"])
def test_the_number_in_D_is_the_one_that_is_given(level):
    assert str(spec(noise={"y": level}).plant.D[0, 1]) == "1/100"


def test_the_channel_has_no_model_and_performance_does_not_ask_for_it():
    made = spec(disturbance="integrator", performance="w")
    assert made.H_names == ("force",)
    assert made.model_states == ("force",)
    assert len(made.drives) == 2
    assert made.generator.Dm.tolist() == [[0, 0], [0, 1]]


def test_noise_of_equations_is_put_in_before_they_are_split():
    """Without it the observer knows the angle, and the drag is a function of the speed; with it of both."""
    quiet, noisy = (od.Spec(system=EQUATIONS, observer=OBSERVER, noise=noise) for noise in ({}, {"encoder": "0.001"}))
    assert [quiet.nonlinearities[0].nq, noisy.nonlinearities[0].nq] == [1, 2]
    assert noisy.plant.exogenous == ("torque", "noise_encoder")
    assert noisy.plant.doubles.D.tolist() == [[0, 0.001]]


def test_a_name_that_is_taken_is_not_taken_twice():
    made = spec(system={**PLANT, "disturbances": ["noise_y"]})
    assert made.plant.exogenous == ("noise_y", "noise_y_")


def test_a_known_term_that_holds_a_noisy_output_is_told():
    made = spec(system={**PLANT, "gx": ["0", "y**3"]})
    assert any("known terms of the plant hold y, and with it its noise" in note for note in made.notes)


# Runs


@pytest.mark.parametrize(
    ("system", "observer", "blocks"),
    [
        (PLANT, OBSERVER, SPRING),
        (PLANT, {**OBSERVER, "type": "linf"}, SPRING),
        (PLANT, {"type": "lipschitz", "objective": "min-gamma", "decay": 0.2, "bounds": {"L": 10}}, [
            {"type": {"lipschitz": 0.5}, "f": "0.5*sin(q)", "Bf": [0, -1], "Cq": [1, 0]}]),
        (PLANT, {**OBSERVER, "bounds": {"L1": 10}}, []),
    ],
    ids=["l2", "linf", "lipschitz", "linear"],
)  # fmt: skip
def test_a_run_draws_the_noise_as_a_part_of_v_and_keeps_its_bounds(system, observer, blocks):
    design = od.solve(spec(system=system, observer=observer, nonlinearities=blocks, noise=HELD, simulation=RUN))
    run = design.simulate()
    n = run["noise_y"]
    assert run["y"] - run["x1"] == pytest.approx(0.01 * n)
    assert n.std() == pytest.approx(1, abs=0.05)
    drive = "w" if observer["type"] == "lipschitz" else "v"
    steps, t = run.steps, run.steps.t
    expected = np.sqrt((1 - np.exp(-8)) / 2 + np.trapezoid(steps.w[:, 1] ** 2, t))
    assert run.summary[f"{drive}_norm2"] == pytest.approx(expected, rel=0.05)
    assert run.summary[f"{drive}_norm2_infinite"] is None
    assert run.summary["bounds"]
    assert all(bound["holds"] for bound in run.summary["bounds"])
    assert run.summary["bounds_omitted"] is None


def test_many_short_periods_add_to_v_and_to_the_bound_what_few_steps_do():
    """The run with noise apart, and the one that integrates all of it, agree on the integrals of v."""
    design = od.solve(spec(noise=HELD, simulation={**RUN, "horizon": 1}))
    quick = design.simulate()
    slow = design.simulate(events={"never": "x1 > 1e6"})  # with events the whole flow is integrated
    for name in ("v_norm2", "v_sup", "z_norm2"):
        assert quick.summary[name] == pytest.approx(slow.summary[name], rel=1e-4)
    assert quick.V_bound == pytest.approx(slow.V_bound, rel=1e-4)


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
def test_a_run_in_samples_draws_it_at_each(estimate):
    system = {**PLANT, "time": "discrete", "period": 0.1, "A": [[1, 0.1], [-0.2, 0.9]], "B": [[0], [0.1]]}
    observer = {"type": "l2", "rho": 0.98, "estimate": estimate}
    blocks = [{"type": {"slope": [-0.5, 0.5]}, "f": "0.5*sin(q)", "Bf": [0, -0.1], "Cq": [1, 0]}]
    design = od.solve(
        spec(system=system, observer=observer, nonlinearities=blocks, simulation={"horizon": 50, "w": ["exp(-t)"]})
    )
    run = design.simulate()
    assert run["y"] - run["x1"] == pytest.approx(0.01 * run["noise_y"])
    assert run["noise_y"].std() == pytest.approx(1, abs=0.1)
    assert run.summary["bounds"]
    assert all(bound["holds"] for bound in run.summary["bounds"])
    rms = design.analysis["noise_rms"]["x1"]["y"]
    assert design.analysis["noise_error"]["x1"] == pytest.approx(0.01 * rms)


def test_it_stands_before_the_channels_of_a_defect():
    discretise = {"period": 0.05, "defect": {"q_rate": 1, "w_rate": 1}}
    system, observer = {**PLANT, "discretise": discretise}, {"type": "linf", "rho": 0.95}
    design = od.solve(spec(system=system, observer=observer, performance=["x1"], simulation={"horizon": 5}))
    assert [*design.analysis["gain_by_channel"]][:2] == ["force", "noise_y"]
    run = design.simulate()
    assert run["y"] - run["x1"] == pytest.approx(0.01 * run["noise_y"])
    assert run["noise_y"].any()
    assert not run["defect_x1"].any()
    assert not run["defect_x2"].any()


def test_noise_of_the_trial_takes_its_place():
    noise = {"type": "uniform", "amplitude": 0.1, "period": 0.1}
    run = od.solve(spec(noise=HELD, simulation={**RUN, "noise": noise})).simulate()
    assert np.abs(run["y"] - run["x1"]).max() <= 0.1
    assert not run["noise_y"].any()
    assert run.summary["bounds_omitted"] == "the guarantee does not cover simulation.noise"


def test_a_density_is_drawn_with_the_rms_of_its_period():
    made = spec(noise={"y": {"density": "0.01"}}, system={**PLANT, "time": "discrete", "period": 0.25},
                observer={"type": "l2", "rho": 1}, simulation=RUN)  # fmt: skip
    assert made.simulation.noise.amplitude == pytest.approx([0.02])


def test_a_run_whose_period_is_not_known_says_what_to_write():
    design = od.solve(spec(simulation=RUN))
    with pytest.raises(UsageError, match=r"write y: \{rms: 0.01, period: ..\}, in s, or give simulation.noise"):
        design.simulate()
    two = {"y": {"rms": "0.01", "period": 0.1}, "x": {"rms": "0.01", "period": 0.2}}
    system = {**PLANT, "C": [[1, 0], [0, 1]], "outputs": ["y", "x"]}
    design = od.solve(spec(system=system, noise=two, simulation=RUN))
    with pytest.raises(UsageError, match=r"held for 0.1 s and 0.2 s"):
        design.simulate()


def test_measurements_at_instants_have_it_at_each_and_no_channel():
    observer = {"type": "sporadic", "T1": 0.1, "T2": 0.2, "gains": {"L": [[2], [1]], "H": [[0]]}}
    made = spec(observer=observer, simulation={**RUN, "horizon": 20})
    assert made.plant.exogenous == ("force",)
    design = od.solve(made)
    rms = design.analysis["noise_rms"]["x1"]["y"]
    assert design.analysis["noise_error"]["x1"] == pytest.approx(0.01 * rms)
    run = design.simulate()
    assert run.schedule is not None
    assert np.abs(run["y"] - run["x1"]).max() > 0
    assert run.summary["bounds"]


def test_observers_that_take_equations_have_it_in_their_runs():
    made = spec(observer={"type": "ekf", "Q": 1, "R": 1e-4}, noise=HELD, simulation=RUN)
    assert made.plant.exogenous == ("force",)
    assert made.simulation.noise.amplitude == pytest.approx([0.01])


def test_it_is_compared_with_an_observer_that_has_no_channel():
    observer = {"type": "ekf", "Q": 1, "R": 1e-4}
    for trial in (RUN, {"horizon": 4}):
        pair = [spec(noise=HELD, simulation=trial), spec(noise=HELD, simulation=trial, observer=observer)]
        assert one_problem(pair) == pair


# What is told


def test_the_gain_of_each_channel_is_told_and_none_exceeds_gamma():
    design = od.solve(spec(disturbance="integrator", performance="w", observer={**OBSERVER, "bounds": {"L1": 30}}))
    each, gamma = design.analysis["gain_by_channel"], design.guarantee.gamma
    assert [*each] == ["v1", "noise_y"]
    assert max(each.values()) <= gamma
    assert "gain by channel" in dict(design.table())


def test_the_error_of_the_declared_noise_is_told_where_its_density_is_known():
    known, unknown = (od.solve(spec(noise=noise)) for noise in (HELD, {"y": "0.01"}))
    density = known.analysis["noise_density"]["x1"]["y"]
    assert known.analysis["noise_error"]["x1"] == pytest.approx(density * 0.01 * np.sqrt(0.002), rel=1e-3)
    assert known.analysis["noise_error"]["x1"] < density * 0.01 * np.sqrt(0.002)  # the error is not that slow
    assert unknown.analysis["noise_error"] is None
    assert "noise error" in dict(known.table())


# Refusals


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"noise": {"z": 1}}, "noise.z: unknown output z; allowed: y"),
        ({"noise": {"amplitude": 1}}, "amplitude is a key of simulation.noise"),
        ({"noise": {"y": 0}}, "noise.y: 0 is not allowed; give a number > 0"),
        ({"noise": {"y": {"rms": 1, "density": 1}}}, "expected a number, {rms: .., period: ..} or {density: ..}"),
        ({"noise": {"y": {"density": 1, "period": 1}}}, "expected a number, {rms: .., period: ..} or {density: ..}"),
        ({"noise": {"y": {"period": 1}}}, "expected a number, {rms: .., period: ..} or {density: ..}"),
        ({"performance": ["noise_y"]}, "unknown state noise_y"),
        (
            {"observer": {"type": "linf", "alpha": 0.2, "reconstruct": "w", "bounds": {"L1": 10}}},
            "takes no noise beside w",
        ),
        (
            {"system": {**PLANT, "time": "discrete", "period": 0.1}, "observer": {"type": "l2"}, "noise": HELD,
             "simulation": RUN},
            "the samples are 0.1 s apart, and noise is drawn at each; leave its period out",
        ),
        (
            {"observer": {"type": "sporadic", "T1": 0.1, "T2": 0.2}, "noise": {"y": {"density": 1}}, "simulation": RUN},
            "a measurement at an instant has no density of noise; give its rms",
        ),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_with_what_does(changes, said):
    assert said in problems(**changes)
