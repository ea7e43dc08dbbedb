"""Sections `simulation:`, `implementation:` and `data:` of a spec: their keys, and what form their values have."""

from typing import Literal, get_args

from obsdesign.families import FAMILIES
from obsdesign.sections.forms import (
    ENTRY,
    FLAG,
    LINE,
    NUMBERS,
    VECTOR,
    Either,
    MapOf,
    Named,
    OneOf,
    Section,
    key,
    required,
)

SAMPLED = f"of the family {' or '.join(name for name, family in FAMILIES.items() if family.sampled)}"
PLACED = f"of the family {', '.join(name for name, family in FAMILIES.items() if family.places)}"
STATE = Named("State", Either("a number, a list of numbers, or numbers by name", ENTRY, NUMBERS, mapping=MapOf(ENTRY)))
STATES = "over x, or over the augmented state; or by name, the others 0"
Numbers = str | list[str] | dict[str, str]

MethodName = Literal["euler", "rk4", "exact"]
RunsName = Literal["continuous", "implementation"]
HoldName = Literal["zero", "first"]
NoiseName = Literal["uniform", "gaussian", "normal"]
SamplingName = Literal["periodic", "random"]


class FromFile(Section):
    """A signal from a column of a file: comma-separated values below a line of names, as the log of `estimate`."""

    file: str = required(LINE, "path of the file, relative to the folder of the spec and below it", example="drive.csv")
    column: str | None = key(LINE, "column of the signal", otherwise="the name of the signal", example="Current (A)")
    time: str | None = key(LINE, "column of the time, in s", otherwise="t", example="time")
    hold: HoldName = key(
        OneOf("hold", get_args(HoldName)),
        "the signal between two rows: that of the first, or on the line between both",
        default="zero",
        example="first",
    )


SIGNALS_BY_NAME = Named(
    "SignalsByName",
    Either(
        "an expression, a list of expressions, or by name expressions and columns of files",
        ENTRY,
        NUMBERS,
        mapping=MapOf(Either("an expression, or {file: .., column: ..}", ENTRY, mapping=FromFile)),
    ),
)
Signals = str | list[str] | dict[str, str | FromFile]


class Law(Section):
    """A law of the sampling instants."""

    law: str = required(ENTRY, "expression of t for the next interval", unit="s", example="0.075 + 0.025*sin(10*t)")


class Noise(Section):
    """Extra measurement noise, constant over each period."""

    type: NoiseName = key(OneOf("noise", get_args(NoiseName)), "its distribution", default="uniform", example="normal")
    amplitude: str | list[str] = required(
        VECTOR, "half width or standard deviation, one number or one for each output", example="[0.02, 2.0e-4]"
    )
    period: str | None = key(
        ENTRY,
        "how long each value holds",
        unit="s",
        otherwise=f"required; {SAMPLED} it is drawn at each measurement, in discrete time at each sample",
        example="1.0e-4",
    )


class Implementation(Section):
    """How the observer runs on a computer, in steps."""

    period: str = required(ENTRY, "time of a step, > 0", unit="s", example="1.0e-3")
    method: MethodName = key(
        OneOf("method", get_args(MethodName)),
        "of a step: Euler, Runge-Kutta 4, or exact of the linear part with the rest held",
        default="rk4",
        example="exact",
    )
    impose: bool = key(
        FLAG,
        f"{PLACED}: whether the design has to be stable in these steps with every constant slope of f",
        default=False,
        example="true",
    )


class Data(Section):
    """Where the signals are in a log, and what is known of the plant that made it."""

    time: str | None = key(LINE, "column of the time, in s", otherwise="t", example="time")
    columns: dict[str, str] = key(
        MapOf(LINE),
        "columns of outputs and inputs, and of what else is known of the plant, by name",
        default={},
        example="{y1: Current (A)}",
    )
    scale: dict[str, str] = key(
        MapOf(ENTRY),
        "factors from the units of columns to those of the spec, by name of signal or time",
        default={},
        example="{y1: 0.001}",
    )
    hold: HoldName = key(
        OneOf("hold", get_args(HoldName)),
        "u and y between two rows: that of the first, or on the line between both",
        default="zero",
        example="first",
    )
    arrival: str | None = key(
        LINE, "column of when a row became known, in s", otherwise="rows are known at their time", example="t_rx"
    )
    v_sup: str | None = key(
        ENTRY, "bound on |v| while the log was made, for radii", otherwise="no radii", example="1.2"
    )
    eta_sup: str | None = key(
        ENTRY,
        f"{SAMPLED}: bound on the noise |eta| of each measurement of the log, for radii",
        otherwise="no radii",
        example="0.01",
    )
    e0: dict[str, str] = key(
        MapOf(ENTRY),
        "bounds on the errors of the estimates of x and xm at the start, for radii",
        default={},
        example="{theta: 0.1, omega: 2}",
    )


class NoiseLevel(Section):
    """White noise of one output, by its rms or by its density."""

    rms: str | None = key(ENTRY, "rms, > 0", unit="unit of the output", otherwise="by density", example="1.0e-3")
    period: str | None = key(
        ENTRY, "how long each value holds", unit="s", otherwise="that of the samples", example="1.0e-3"
    )
    density: str | None = key(
        ENTRY, "two-sided density, rms sqrt(period)", unit="unit/sqrt(Hz)", otherwise="by rms", example="3.0e-5"
    )


class Simulation(Section):
    """How to try the observer."""

    horizon: str = required(ENTRY, "length of the run, > 0", unit="s", example="10")
    x0: Numbers | None = key(STATE, f"initial state of the plant {STATES}", otherwise="0", example="[1, 0]")
    xhat0: Numbers | None = key(STATE, f"initial estimate {STATES}", otherwise="0", example="{x1: 0.5}")
    x0_width: Numbers | None = key(
        STATE,
        "half-widths over x: a run starts anywhere within x0 less and plus these, drawn uniformly with its seed; or by "
        "name, the others 0",
        otherwise="every run starts at x0",
        example="{angle: 0.2}",
    )
    uncertainty: dict[str, str] = key(
        MapOf(ENTRY),
        "relative half-widths of `parameters`, as shares or in %: the plant of a run has others, drawn uniformly with "
        "its seed, the observer keeps the nominal ones, and nothing is guaranteed",
        default={},
        example='{J: 0.1, friction: "50 %"}',
    )
    w: Signals | None = key(
        SIGNALS_BY_NAME,
        "disturbance and noise: expressions of t and the states, or columns of files",
        otherwise="0, or what v makes of the disturbance model",
        example="{torque: 2*exp(-t)}",
    )
    v: Signals | None = key(
        SIGNALS_BY_NAME,
        "what drives the disturbance model: expressions of t, or columns of files; not beside w",
        otherwise="0, or what makes w",
        example="[exp(-t)]",
    )
    u: Signals | None = key(
        SIGNALS_BY_NAME,
        "known inputs: expressions of t and the states, or columns of files",
        otherwise="0",
        example="{voltage: 6*sin(t), load: {file: drive.csv, column: Load (N)}}",
    )
    events: dict[str, str] = key(
        MapOf(ENTRY),
        "conditions that end a run when they become true, by name",
        default={},
        example="{leaves: abs(x1) > 2}",
    )
    noise: Noise | None = key(
        Noise,
        "extra measurement noise",
        otherwise="none",
        example="{type: normal, amplitude: 0.002, period: 1.0e-3}",
    )
    sampling: SamplingName | Law | None = key(
        Either(
            "periodic, random, or {law: an expression of t}",
            OneOf("sampling", get_args(SamplingName)),
            mapping=Law,
        ),
        f"{SAMPLED}: when measurements arrive: every T2, at random in [T1, T2], or by a law",
        otherwise="periodic",
        example="random",
    )
    period: str | None = key(ENTRY, f"{SAMPLED}: of periodic sampling", unit="s", otherwise="T2", example="0.08")
    dropout: str | None = key(
        ENTRY, f"{SAMPLED}: share of the measurements that are lost, in [0, 1)", otherwise="0", example="0.1"
    )
    xi0: dict[str, str] | None = key(
        MapOf(ENTRY), "coordinates at t = 0, by name", otherwise="those of xhat0, or 0", example="{xi1: 0.2}"
    )
    theta0: str | list[str] | dict[str, str] | None = key(
        Either("a number, a list, or values by coordinate", ENTRY, NUMBERS, mapping=MapOf(ENTRY)),
        "correction before the first measurement, or estimated constants of coordinates",
        otherwise="0",
        example="{xi1: 0.5}",
    )
    observer: RunsName = key(
        OneOf("observer", get_args(RunsName)),
        "how the observer runs: in continuous time, or in the steps of `implementation`, on u and y at their instants",
        default="continuous",
        example="implementation",
    )
    seed: str | None = key(
        ENTRY, "of noise, of random intervals, of x0_width and of uncertainty", otherwise="0", example="1"
    )
    points: str | None = key(
        ENTRY,
        "samples for files and figures, in discrete time for figures alone; at most 1e6",
        otherwise="2000",
        example="500",
    )
