"""The export to FMI 2.0: an FMU that is valid, compiles, and estimates in a co-simulation what the simulator does."""

import io
import platform
import shutil
import subprocess
import sys
import zipfile
from importlib import util
from xml.etree import ElementTree

import numpy as np
import pytest
from flint import fmpq
from support.exported import INPUTS, OBSERVERS, STATES, Reference, deviation, hostile, subject, xhat0_of

import obsdesign as od
from obsdesign.exports import fmu
from obsdesign.exports.subject import Subject
from obsdesign.expressions import parse
from obsdesign.families.observer import Observer
from obsdesign.stepping.implemented import Implemented

fmpy = pytest.mark.skipif(util.find_spec("fmpy") is None, reason="FMPy is not installed")
linux = pytest.mark.skipif(
    shutil.which("gcc") is None or (sys.platform, platform.machine()) != ("linux", "x86_64"),
    reason="gcc on Linux is needed",
)
STRICT = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-shared", "-fPIC"]


def unpacked(made, folder):
    """The exported FMU, unpacked."""
    ((name, content),) = fmu.files(made, None).items()
    (folder / name).write_bytes(content)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        archive.extractall(folder / made.name)
    return folder / made.name


class Slave:
    """An FMU in a co-simulation."""

    def __init__(self, made, folder, xhat0=None, start=0.0):
        from fmpy import read_model_description
        from fmpy.fmi2 import FMU2Slave

        folder, self.said = unpacked(made, folder), []
        (folder / "binaries" / "linux64").mkdir(parents=True)
        library = folder / "binaries" / "linux64" / f"{made.name}.so"
        subprocess.run([*STRICT, *folder.glob("sources/*.c"), "-o", library, "-lm"], check=True)
        self.described = read_model_description(folder)
        self.places = {one.name: one.valueReference for one in self.described.modelVariables}
        self.hats = [one.valueReference for one in self.described.modelVariables if one.causality == "output"]
        ID = self.described.coSimulation.modelIdentifier
        self.fmu = FMU2Slave(
            guid=self.described.guid, unzipDirectory=str(folder), modelIdentifier=ID, instanceName="one"
        )
        self.fmu.instantiate(callbacks=self.callbacks())
        self.fmu.setupExperiment(startTime=start)
        self.fmu.enterInitializationMode()
        for name, value in zip(made.implemented.plant_states, xhat0 or (), strict=bool(xhat0)):
            if f"xhat0_{name}" in self.places:
                self.set({f"xhat0_{name}": value})
        self.fmu.exitInitializationMode()

    def callbacks(self):
        """Callbacks that keep what is logged."""
        from fmpy import calloc, free
        from fmpy.fmi2 import (
            fmi2CallbackAllocateMemoryTYPE,
            fmi2CallbackFreeMemoryTYPE,
            fmi2CallbackFunctions,
            fmi2CallbackLoggerTYPE,
        )

        made = fmi2CallbackFunctions()
        made.logger = fmi2CallbackLoggerTYPE(lambda *said: self.said.append(said[4].decode()))
        made.allocateMemory, made.freeMemory = fmi2CallbackAllocateMemoryTYPE(calloc), fmi2CallbackFreeMemoryTYPE(free)
        return made

    def set(self, values):
        """Set variables by their names."""
        self.fmu.setReal([self.places[name] for name in values], list(values.values()))

    def estimates(self):
        return self.fmu.getReal(self.hats)

    def run(self, made, rows):
        """Estimates after each step, in which u and y of its row are held."""
        found, names = [], (*made.inputs, *made.outputs)
        for t, u, y, measured, on in zip(rows.t, rows.u, rows.y, rows.measured, rows.on[:-1], strict=False):
            self.set(dict(zip(names, (*u, *y), strict=True)))
            if made.instants:
                self.fmu.setBoolean([self.places["measured"]], [bool(measured)])
            self.fmu.doStep(t, on)
            found.append(self.estimates())
        return np.array(found)


def expected(made, rows, xhat0=None):
    """Estimates of the simulator after each step; where they know their sample, of the sample before it."""
    reference, found = Reference(made.implemented, xhat0), []
    for k, (t, u, y, on_) in enumerate(zip(rows.t, rows.u, rows.y, rows.on[:-1], strict=False)):
        if made.ahead:
            found.append(reference.estimate(t, u, y))
            reference.step(t, np.concatenate([u, rows.u[k + 1]]), rows.y[k + 1])
            continue
        if rows.measured[k]:
            reference.jump(t, u, y)
        if made.instants and abs(on_ - made.period) > 1e-9 * made.period:
            reference.flow(t, on_, u)
        else:
            reference.step(t, u, y)
        found.append(reference.estimate(t + on_, u, y))
    return np.array(found)


@fmpy
@linux
@pytest.mark.parametrize("elsewhere", [False, True], ids=["xhat0", "another"])
@pytest.mark.parametrize(("name", "period", "method"), OBSERVERS)
def test_a_co_simulation_estimates_what_the_simulator_does(name, period, method, elsewhere, tmp_path):
    made, rows = subject(name, period, method)
    xhat0 = xhat0_of(made) if elsewhere else None
    slave = Slave(made, tmp_path, xhat0)
    assert deviation(slave.run(made, rows), expected(made, rows, xhat0)) < 1e-12


@fmpy
@pytest.mark.parametrize(("name", "period", "method"), OBSERVERS)
def test_the_description_is_valid(name, period, method, tmp_path):
    from fmpy import read_model_description
    from fmpy.validation import validate_fmu

    made, _ = subject(name, period, method)
    folder = unpacked(made, tmp_path)
    assert validate_fmu(str(tmp_path / f"{made.name}.fmu")) == []
    known = {one.name: one for one in read_model_description(folder).modelVariables}
    assert [name for name, one in known.items() if one.causality == "output"] == [f"hat_{n}" for n in made.estimates]
    assert list(known)[: len(made.inputs) + len(made.outputs)] == [*made.inputs, *made.outputs]
    for name in (*made.inputs, *made.outputs):
        assert known[name].unit == made.units.get(name)
    for name in made.estimates:
        assert known[f"hat_{name}"].unit == made.units.get(name)
    described = ElementTree.parse(folder / "modelDescription.xml").getroot().get("description")
    assert described.startswith("\n".join(made.words))


@fmpy
@linux
@pytest.mark.parametrize("name", ["pendulum-embedded", "discrete-motor"])
def test_fmpy_builds_and_simulates_it(name, tmp_path):
    from fmpy import simulate_fmu
    from fmpy.build import build_platform_binary

    made, rows = subject(name)
    folder = unpacked(made, tmp_path)
    (tmp_path / "build").mkdir()
    build_platform_binary(folder, tmp_path / "build")
    names = [*made.inputs, *made.outputs]
    signals = np.zeros(len(rows.t), dtype=[(name, float) for name in ("time", *names)])
    for column, values in zip(("time", *names), (rows.t, *rows.u.T, *rows.y.T), strict=True):
        signals[column] = values
    found = simulate_fmu(folder, stop_time=rows.t[-1], output_interval=made.period, input=signals)
    hats = np.column_stack([found[f"hat_{name}"] for name in made.estimates])[1:]
    assert deviation(hats, expected(made, rows)) < 1e-9


@fmpy
@linux
def test_a_state_of_it_is_kept_and_set(tmp_path):
    made, rows = subject("pendulum-embedded")
    slave = Slave(made, tmp_path)
    first = slave.run(made, rows)
    state = slave.fmu.getFMUState()
    kept = slave.fmu.serializeFMUstate(state)
    again = slave.run(made, rows)
    slave.fmu.setFMUState(state)
    assert slave.estimates() == first[-1].tolist()
    assert (slave.run(made, rows) == again).all()
    other = slave.fmu.deSerializeFMUstate(kept)
    slave.fmu.setFMUState(other)
    assert (slave.run(made, rows) == again).all()
    for one in (state, other):
        slave.fmu.freeFMUState(one)
    slave.fmu.reset()
    assert slave.estimates() == [0, 0, 0]


@fmpy
@linux
def test_what_it_cannot_do_is_said_and_changes_nothing(tmp_path):
    from fmpy.fmi1 import FMICallException

    made, _ = subject("pendulum-embedded")
    slave = Slave(made, tmp_path, [0.5, -1.0])
    for action, said in (
        (
            lambda: slave.fmu.doStep(0.0, 0.0015),
            "a step of 0.0015 s; take a multiple of 0.001 s, the period of the observer",
        ),
        (lambda: slave.fmu.doStep(0.0, 0.0005), "a step of 0.0005 s"),
        (lambda: slave.fmu.doStep(0.0, float("nan")), "take a multiple"),
        (lambda: slave.set({"y_angle": float("inf")}) or slave.fmu.doStep(0.0, 0.001), "an input is not finite"),
        (lambda: slave.set({"y_angle": 0.0, "hat_angle": 1.0}), "this variable cannot be set"),
        (lambda: slave.set({"xhat0_angle": 1.0}), "xhat0 is set before the start"),
        (lambda: slave.fmu.getReal([99]), "there is no such variable"),
        (lambda: slave.fmu.getInteger([0]), "there is no such variable"),
        (lambda: slave.fmu.setBoolean([0], [True]), "there is no such variable"),
        (slave.fmu.enterInitializationMode, "it is initialized once"),
    ):
        with pytest.raises(FMICallException):
            action()
        assert said in slave.said[-1]
    assert slave.estimates() == [0.5, -1.0, 0.0]
    assert slave.fmu.getReal([slave.places["xhat0_speed"]]) == [-1.0]


@fmpy
@linux
def test_a_step_over_several_periods_is_several_steps(tmp_path):
    for name, period, method, parts in (
        ("pendulum-embedded", None, None, (1, 1, 1)),
        ("lost-packets", "1.0e-2", "rk4", (1, 1, 0.5)),
    ):
        made, _ = subject(name, period, method)
        reference = Reference(made.implemented, xhat0_of(made))
        slave = Slave(made, tmp_path, xhat0_of(made), start=7.0)
        y = dict.fromkeys(made.outputs, 0.3)
        slave.set(y)
        if made.instants:
            slave.fmu.setBoolean([0], [True])
            reference.jump(7.0, (), tuple(y.values()))
        t = 7.0
        for part in parts:
            if part == 1:
                reference.step(t, (), tuple(y.values()))
            else:
                reference.flow(t, part * made.period, ())
            t += part * made.period
        slave.fmu.doStep(7.0, t - 7.0)
        assert slave.estimates() == pytest.approx(list(reference.estimate(t, (), tuple(y.values()))), rel=1e-12)


@fmpy
@linux
def test_hostile_names_stay_themselves_and_are_distinct(tmp_path):
    from fmpy.validation import validate_fmu

    made = od.export(hostile(), "fmu", name="while_")
    made.write(tmp_path)
    assert validate_fmu(str(tmp_path / "while_.fmu")) == []
    slave = Slave(made.subject, tmp_path)
    assert [name for name in slave.places if name in INPUTS] == list(INPUTS)
    assert {f"hat_{name}" for name in STATES} < set(slave.places)
    a = parse("measured*xhat0_a - hat_a", ("measured", "xhat0_a", "hat_a"))
    clashing = Observer({"hat_a": a}, {"a": parse("hat_a", ("hat_a",))}, ("measured", "xhat0_a"), ("hat_y",),
                        jump={"hat_a": parse("hat_y", ("hat_y",))}, twins={"hat_a": "a"})  # fmt: skip
    one = Implemented(clashing, fmpq(1, 10), "rk4", ("a",), np.zeros(1))
    slave = Slave(Subject("clash", one, ('said "so" & <so>',), {"a": "°C & <x>"}), tmp_path)
    assert list(slave.places) == ["measured", "xhat0_a", "hat_y", "measured_", "hat_a", "xhat0_a_"]
    assert validate_fmu(str(tmp_path / "clash.fmu")) == []


def test_the_bytes_are_the_same_again():
    made, rows = subject("pendulum-embedded")
    assert fmu.files(made, rows) == fmu.files(made, rows)
    (content,) = fmu.files(made, rows).values()
    entries = zipfile.ZipFile(io.BytesIO(content)).infolist()
    assert {one.date_time for one in entries} == {fmu.EPOCH}
    sources = [f"sources/pendulum_embedded{end}" for end in (".h", ".c", "_fmu.c")]
    assert [one.filename for one in entries] == ["modelDescription.xml", *sources]


def test_another_gain_has_another_guid():
    made, rows = subject("noisy-output", "1.0e-2", "exact")
    other, _ = subject("noisy-output", "1.0e-2", "rk4")
    assert fmu.identity(made, ["a"]) != fmu.identity(made, ["b"])
    assert fmu.files(made, rows) != fmu.files(other, rows)
