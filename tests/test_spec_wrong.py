"""Wrong specs: each is answered in one line for each error, at its place, with what is allowed."""

from pathlib import Path

import pytest
from support.commands import run
from support.wrong_specs import problems_of, wrong_in

from obsdesign.reading import loads

BASE = """\
obsdesign: 1
parameters: {b: 0.5}
system:
  A: [[0, 1], [-1, 0]]
  B: [[0], [1]]
  C: [[1, 0]]
  D: [[b]]
nonlinearities:
  - type: monotone
    f: q**3
    Bf: [0, 1]
    Cq: [0, 1]
disturbance: integrator
performance: x
observer:
  type: l2
  alpha: 0.5
simulation:
  horizon: 10
  x0: [1, 0]
  w: [sin(t)]
expect:
  status: certified
"""


wrong = wrong_in(BASE)
A, B, C, D = "  A: [[0, 1], [-1, 0]]", "  B: [[0], [1]]", "  C: [[1, 0]]", "  D: [[b]]"
ALPHA, TYPE, BF, CQ, F = (
    "  alpha: 0.5",
    "  - type: monotone",
    "    Bf: [0, 1]",
    "    Cq: [0, 1]",
    "    f: q**3",
)
DISTURBANCE, PERFORMANCE, HORIZON, X0 = (
    "disturbance: integrator",
    "performance: x",
    "  horizon: 10",
    "  x0: [1, 0]",
)
MATRICES = BASE[BASE.index("parameters") : BASE.index("nonlinearities")]
W, STATUS, PARAMETERS = "  w: [sin(t)]", "  status: certified", "parameters: {b: 0.5}"

SHAPES = [
    wrong(A, "  A: [[0, 1]]", "system.A", "square", "1x2", place=(4, 6)),
    wrong(A, "  A: [0, 1]", "system.A", "square", "a vector of 2"),
    wrong(A, "  A: []", "system.A", "square"),
    wrong(A, "  A: [[0, 1], [-1]]", "system.A[1]", "a row of 1", place=(4, 15)),
    wrong(B, "  B: [[0, 1], [1, 0], [2, 2]]", "system.B", "expected 2 rows (one for each state), found 3x2"),
    wrong(B, "  B: [0, 1, 2]", "system.B", "2 rows (one for each state)", "a vector of 3"),
    wrong(B, "  B: 1", "system.B", "2 rows", "a number"),
    wrong(C, "  C: [[1, 0, 0]]", "system.C", "expected 2 columns (one for each state), found 1x3"),
    wrong(C, "  C: []", "system.C", "1 row (one for each output)"),
    wrong(D, "  D: [[b, 0]]", "system.D", "expected 1 column (one for each w), found 1x2", place=(7, 6)),
    wrong(BF, "    Bf: [0, 1, 0]", "nonlinearities[0].Bf", "2 rows (one for each state)"),
    wrong(BF, "    Bf: [[0, 0], [1, 0]]", "nonlinearities[0].type", "f has 2 components and q has 1"),
    wrong(
        BF + "\n" + CQ,
        "    Bf: [[0, 0], [1, 0]]\n    Cq: [[0, 1], [1, 0]]",
        "nonlinearities[0].f",
        "2 expressions",
    ),
    wrong(CQ, "    Cq: [[0, 1], [1, 0]]", "nonlinearities[0].type", "f has 1 components and q has 2"),
    wrong(CQ, "    Cq: [0, 1]\n    Dq: [[1, 0]]", "nonlinearities[0].Dq", "1 column (one for each w), found 1x2"),
    wrong(CQ, "    Cq: [0, 1]\n    Dqf: [1, 0]", "nonlinearities[0].Dqf", "1 column", "a vector of 2"),
    wrong(CQ, "    Cq: [0, 1]\n    Df: [1, 0]", "nonlinearities[0].Df", "one for each output"),
    wrong(ALPHA, "  alpha: 0.5\n  L2: [[0, 0]]", "observer.L2", "1 column (one for each output), found 1x2"),
    wrong(
        ALPHA,
        "  alpha: 0.5\n  gains: {L1: [1, 2]}",
        "observer.gains.L1",
        "3 rows (one for each augmented state)",
    ),
    wrong(PERFORMANCE, "performance: {H: [1, 0]}", "performance.H", "3 columns (one for each augmented state)"),
    wrong(X0, "  x0: [1, 0, 0, 0]", "simulation.x0", "2 numbers", "or 3 with those of the disturbance model"),
    wrong(X0, "  x0: 1", "simulation.x0", "2 numbers", "a number"),
    wrong(W, "  w: [sin(t), t]", "simulation.w", "1 expression (one for each w), found 2"),
    wrong(W, "  v: [0, 0]", "simulation.v", "1 expression (one for each v), found 2"),
    wrong(W, "  u: [1]", "simulation.u", "0 expressions (one for each input), found 1"),
    wrong(A, "  states: [x1]\n" + A, "system.states", "2 names (one for each state), found 1"),
    wrong(DISTURBANCE, "disturbance: [integrator, unknown]", "disturbance", "1 model (one for each w), found 2"),
    wrong(DISTURBANCE, "disturbance: {model: {Am: [[1, 2]]}}", "disturbance.model.Am", "square"),
    wrong(
        DISTURBANCE,
        "disturbance: {model: {Am: 0, Bm: 1, Cm: [1, 1]}}",
        "disturbance.model.Bm",
        "2 rows (one for each state of the disturbance model)",
    ),
    wrong(W, "  gx: 0", "simulation.gx", "unknown key gx"),
    wrong(D, D + "\n  gx: [0]", "system.gx", "2 expressions (one for each state)"),
    wrong(
        HORIZON,
        HORIZON + "\n  noise: {amplitude: [1, 2], period: 1}",
        "simulation.noise.amplitude",
        "1 number (one for each output), found 2",
    ),
]

FORMS = [
    wrong(A, "  A: {a: 1}", "system.A", "expected a number, a vector or a list of rows; found a mapping"),
    wrong(A, "  A: [[0, true], [-1, 0]]", "system.A[0][1]", "expected a number", "found true", place=(4, 11)),
    wrong(A, "  A: [[0, [1]], [-1, 0]]", "system.A[0][1]", "found a list"),
    wrong(A, "  A: [[0, 1], 2]", "system.A[1]", "expected a list; found 2"),
    wrong(A, "  A:", "system.A", "has no value"),
    wrong(A, "  A: [[0, ~], [1, 0]]", "system.A[0][1]", "has no value"),
    wrong(A + "\n", "", "system.A", "is required", place=(3, 1)),
    wrong("  type: l2\n", "", "observer.type", "is required"),
    wrong("obsdesign: 1\n", "", "obsdesign", "is required"),
    wrong("obsdesign: 1", "obsdesign: 2", "obsdesign", "format 2 is not known", "format 1"),
    wrong("obsdesign: 1", "obsdesign: true", "obsdesign", "found true"),
    wrong(B, "  BB: [[0], [1]]", "system.BB", "unknown key BB; did you mean B?", place=(5, 3)),
    wrong("system:", "sytem:", "sytem", "did you mean system?", place=(3, 1)),
    wrong(
        ALPHA,
        "  aplha: 0.5",
        "observer.aplha",
        "unknown key aplha; did you mean alpha?",
        "allowed: type, rho, estimate, poles, L2",
    ),
    wrong(TYPE, "  - type: monoton", "nonlinearities[0].type", "did you mean monotone?"),
    wrong(TYPE, "  - type: {lipschits: 1}", "nonlinearities[0].type.lipschits", "did you mean lipschitz?"),
    wrong(TYPE, "  - type: lipschitz", "nonlinearities[0].type", "needs data: {lipschitz: ..}"),
    wrong(TYPE, "  - type: {monotone: 1}", "nonlinearities[0].type.monotone", "takes no data"),
    wrong(TYPE, "  - type: {}", "nonlinearities[0].type", "one of the keys lipschitz, slope, sector"),
    wrong(TYPE, "  - type: {lipschitz: 1, slope: [0, 1]}", "nonlinearities[0].type", "one of the keys"),
    wrong(TYPE, "  - type: {sector: {K1: 1}}", "nonlinearities[0].type.sector.K2", "is required"),
    wrong(TYPE, "  - type: {sector: auto}", "nonlinearities[0].type.sector", "the keys K1, K2; found auto"),
    wrong(TYPE, "  - type: {sector: {K1: 0, K3: 1, K2: 1}}", "nonlinearities[0].type.sector.K3", "allowed: K1, K2"),
    wrong(TYPE, "  - type: {ball: {K: 0}}", "nonlinearities[0].type.ball.W", "is required"),
    wrong(
        TYPE,
        "  - type: {jacobian: []}",
        "nonlinearities[0].type.jacobian",
        "expected at least 1 item; found an empty list",
    ),
    wrong(TYPE, "  - type: {jacobian: 3}", "nonlinearities[0].type.jacobian", "a list of matrices, or auto; found 3"),
    wrong(TYPE, "  - type: {cone: auto}", "nonlinearities[0].type.cone", "expected a list; found auto"),
    wrong(TYPE, "  - type: {one-sided-lipschitz: 1}", "nonlinearities[0].type.one-sided-lipschitz", "rho, beta, phi"),
    wrong(TYPE, "  - type: {monotone: auto}", "nonlinearities[0].type.monotone", "takes no data"),
    wrong(TYPE, "  - type: {auto: 1}", "nonlinearities[0].type.auto", "a mapping with the keys region; found 1"),
    wrong(TYPE, "  - type: {auto: {regoin: {}}}", "nonlinearities[0].type.auto.regoin", "did you mean region?"),
    wrong(TYPE, "  - type: atuo", "nonlinearities[0].type", "did you mean auto?"),
    wrong(TYPE, "  - type: {region: {q: [0, 1]}}", "nonlinearities[0].type", "one of the keys lipschitz"),
    wrong(TYPE, "  - type: {lipschitz: 1, region: 1}", "nonlinearities[0].type.region", "expected a mapping; found 1"),
    wrong(TYPE, TYPE + "\n    region: {q: 1}", "nonlinearities[0].region.q", "expected a list; found 1"),
    wrong(TYPE, TYPE + "\n    region: {q: [1]}", "nonlinearities[0].region.q", "expected at least 2 items"),
    wrong(TYPE, "  - type: {slope: [1]}", "nonlinearities[0].type.slope", "expected at least 2 items"),
    wrong(TYPE, "  - type: {slope: 1}", "nonlinearities[0].type.slope", "expected [lo, hi], or auto; found 1"),
    wrong("  type: l2", "  type: l3", "observer.type", "unknown observer l3; allowed: l2"),
    wrong(ALPHA, "  reconstruct: w", "observer.reconstruct", "not available for type l2; it needs type linf"),
    wrong(ALPHA, "  objective: min-gama", "observer.objective", "did you mean min-gamma?"),
    wrong(ALPHA, "  objective: {gama: 1}", "observer.objective.gama", "did you mean gamma?"),
    wrong(ALPHA, "  bounds: {L1: {spectral: 1}}", "observer.bounds.L1.spectral", "allowed: frobenius"),
    wrong(ALPHA, "  alpha: [1, 2]", "observer.alpha", "a number, or a range"),
    wrong(ALPHA, "  alpha: {min: 1, max: 2, log: yes}", "observer.alpha.log", "true or false; found yes"),
    wrong(DISTURBANCE, "disturbance: integrater", "disturbance", "did you mean integrator?"),
    wrong(DISTURBANCE, "disturbance: sinusoid", "disturbance", "needs data"),
    wrong(DISTURBANCE, "disturbance: {sinusoid: 2}", "disturbance.sinusoid", "a mapping with the keys omega"),
    wrong(
        DISTURBANCE,
        "disturbance: {type: {sinusoid: {omgea: 2}}}",
        "disturbance.type.sinusoid.omgea",
        "omega?",
    ),
    wrong(DISTURBANCE, "disturbance: {}", "disturbance", "one of the keys sinusoid"),
    wrong(PERFORMANCE, "performance: y", "performance", "unknown performance y", "allowed: x, w, all"),
    wrong(PERFORMANCE, "performance: [x1, x4]", "performance[1]", "unknown state x4", place=(14, 19)),
    wrong(PERFORMANCE, "performance: [x1, x2, x1]", "performance[2]", "x1 is named already", place=(14, 23)),
    wrong(PERFORMANCE, "performance: {of: [x1, x1]}", "performance.of[1]", "x1 is named already"),
    wrong(PERFORMANCE, "performance: {G: 1}", "performance.G", "allowed: H"),
    wrong(PERFORMANCE, "performance: []", "performance", "at least one state"),
    wrong(HORIZON, "  duration: 10", "simulation.duration", "unknown key duration"),
    wrong(HORIZON, HORIZON + '\n  "a\\nb": 1', "simulation", "a key is one line of text"),
    wrong(HORIZON, f"  {'k' * 900}: 10", f"simulation.{'k' * 60}..", "unknown key"),
    wrong(DISTURBANCE, "disturbance: ''", "disturbance", "unknown disturbance an empty text"),
    wrong(TYPE, "  - type: {multiplier: 1}", "nonlinearities[0].type", "M is 1 x 1"),
    wrong(HORIZON, HORIZON + "\n  sampling: periodic", "simulation.sampling", "belongs to observer.type sporadic"),
    wrong(
        HORIZON,
        HORIZON + "\n  noise: {type: white, amplitude: 1, period: 1}",
        "simulation.noise.type",
        "uniform",
    ),
    wrong(STATUS, "  status: certifed", "expect.status", "did you mean certified?"),
    wrong(STATUS, "  limit.gamma: {verifed: 1}", "expect.limit.gamma.verifed", "did you mean verified?"),
    wrong(STATUS, "  limit gamma: 1", "expect.limit gamma", "no path into a result"),
    wrong(STATUS, "  limit.gamma: {verified: 1, rtol: -1}", "expect.limit.gamma.rtol", "give a number >= 0"),
    wrong(MATRICES, "system: [1]\n", "system", "a mapping with the keys"),
    wrong(
        MATRICES,
        "system: {dynamics: {x1: -x1}, outputs: {y: x1}}\n",
        "nonlinearities",
        "are the terms of system.dynamics, which are found by themselves: leave this out; the type of a term",
    ),
]

VALUES = [
    wrong(A, "  A: [[0, .inf], [-1, 0]]", "system.A[0][1]", ".inf is not a finite number"),
    wrong(A, "  A: [[0, -.inf], [-1, 0]]", "system.A[0][1]", "-.inf is not a finite number"),
    wrong(A, "  A: [[0, .nan], [-1, 0]]", "system.A[0][1]", ".nan is not a finite number"),
    wrong(A, "  A: [[0, 1e400], [-1, 0]]", "system.A[0][1]", "out of the range of a double"),
    wrong(A, "  A: [[0, 1e-999999999], [-1, 0]]", "system.A[0][1]", "out of the range of a double"),
    wrong(A, "  A: [[0, exp(1000)], [-1, 0]]", "system.A[0][1]", "not finite"),
    wrong(A, "  A: [[0, 1/0], [-1, 0]]", "system.A[0][1]", "division by zero", place=(4, 12)),
    wrong(A, "  A: [[0, c], [-1, 0]]", "system.A[0][1]", "unknown name 'c'"),
    wrong(A, "  A: [[0, 'b + c'], [-1, 0]]", "system.A[0][1]", "unknown name 'c'", place=(4, 16)),
    wrong(A, "  A: [[0, x1], [-1, 0]]", "system.A[0][1]", "unknown name 'x1'"),
    wrong(A, "  A: [[0, no], [-1, 0]]", "system.A[0][1]", "unknown name 'no'"),
    wrong(A, "  A: [[0, 2001-12-10], [-1, 0]]", "system.A[0][1]", "reads as a date or a time"),
    wrong(A, "  A: [[0, 2001-12-10 01:02:03], [-1, 0]]", "system.A[0][1]", "reads as a date or a time"),
    wrong(A, "  A: [[0, 12:30], [-1, 0]]", "system.A[0][1]", "reads as a date or a time"),
    wrong(A, "  A: [[0, 1:30:00], [-1, 0]]", "system.A[0][1]", "reads as a date or a time"),
    wrong(A, "  A: [[0, 1_000], [-1, 0]]", "system.A[0][1]", "expected an operator"),
    wrong(A, "  A: [[0, 1,5], [-1, 0]]", "system.A[1]", "a row of 2"),
    wrong(A, "  A: [[0, sqrt(-1)], [-1, 0]]", "system.A[0][1]", "undefined"),
    wrong(A, "  A: [[0, __import__('os').system('true')], [-1, 0]]", "system.A[0][1]", "not allowed"),
    wrong(A, "  A: [[0, 9**9**9**9], [-1, 0]]", "system.A[0][1]", "exponent"),
    wrong(A, f"  A: [[0, {'(' * 4000}1{')' * 4000}], [-1, 0]]", "system.A[0][1]", "nested deeper than 100"),
    wrong(A, f"  A: [[0, {'1+' * 6000}1], [-1, 0]]", "system.A[0][1]", "10000"),
    wrong(A, f"  A: [[0, {'9' * 20000}], [-1, 0]]", "system.A[0][1]", "10000"),
    wrong(PARAMETERS, "parameters: {b: 0.5, t: 1}", "parameters.t", "is the time", place=(2, 22)),
    wrong(PARAMETERS, "parameters: {b: 0.5, q1: 1}", "parameters.q1", "argument of a nonlinearity"),
    wrong(PARAMETERS, "parameters: {b: 0.5, pi: 3}", "parameters.pi", "choose another name"),
    wrong(PARAMETERS, "parameters: {b: 0.5, sin: 3}", "parameters.sin", "choose another name"),
    wrong(PARAMETERS, "parameters: {b: 0.5, x1: 3}", "parameters.x1", "is a state already"),
    wrong(PARAMETERS, "parameters: {b: 0.5, y1: 3}", "parameters.y1", "is an output already"),
    wrong(PARAMETERS, "parameters: {b: 0.5, w1: 3}", "parameters.w1", "is an exogenous input already"),
    wrong(PARAMETERS, "parameters: {b: 0.5, a b: 3}", "parameters.a b", "is not a name"),
    wrong(PARAMETERS, "parameters: {b: 2*c, c: 1}", "parameters.b", "unknown name 'c'"),
    wrong(PARAMETERS, "parameters: {b: [1]}", "parameters.b", "found a list"),
    wrong(A, "  states: [x1, x1]\n" + A, "system.states[1]", "x1 is a state already"),
    wrong(A, "  states: [x1, y1]\n" + A, "system.outputs", "y1 is a state already"),
    wrong(A, "  states: [x1, sin]\n" + A, "system.states[1]", "function or a constant"),
    wrong(A, "  states: [x1, w1]\n" + A, "system.states[1]", "w1 is an exogenous input already"),
    wrong(A, "  states: [x1, hat_x1]\n" + A, "system.states[1]", "estimate"),
    wrong(A, "  units: {z: m}\n" + A, "system.units.z", "unknown signal z"),
    wrong(TYPE, "  - type: {lipschitz: -1}", "nonlinearities[0].type.lipschitz", "give a number >= 0"),
    wrong(
        TYPE,
        "  - type: {lipschitz: auto}",
        "nonlinearities[0].type",
        "df/dq cannot be bounded above at q in",
        "give a smaller region",
        place=(9, 11),
    ),
    wrong(TYPE + "\n" + F, "  - type: auto", "nonlinearities[0].type", "auto is derived from f; give f"),
    wrong(TYPE + "\n" + F, "  - type: {slope: auto}", "nonlinearities[0].type", "slope auto is derived from f"),
    wrong(TYPE + "\n" + F, "  - type: auto\n    f: -q**3", "nonlinearities[0].type", "bounded below", "-f and -Bf"),
    wrong(TYPE + "\n" + F, "  - type: auto\n    f: sign(q)", "nonlinearities[0].type", "may jump", "q*abs(q)"),
    wrong(TYPE + "\n" + F, "  - type: {cocoercive: auto}\n    f: sin(q)", "nonlinearities[0].type", "may be -1"),
    wrong(TYPE, TYPE + "\n    region: {q: [1, -1]}", "nonlinearities[0].region.q", "1 is not below -1", place=(10, 17)),
    wrong(TYPE, TYPE + "\n    region: {q: [1, 1]}", "nonlinearities[0].region.q", "give [low, high]"),
    wrong(TYPE, TYPE + "\n    region: {q: [.nan, 1]}", "nonlinearities[0].region.q[0]", "not a finite number"),
    wrong(TYPE, TYPE + "\n    region: {q: [0, oops]}", "nonlinearities[0].region.q[1]", "unknown name 'oops'"),
    wrong(TYPE, TYPE + "\n    region: {p: [0, 1]}", "nonlinearities[0].region.p", "unknown variable p", "q, q1"),
    wrong(TYPE, TYPE + "\n    region: {y1: [0, 1]}", "nonlinearities[0].region.y1", "f does not depend on y1"),
    wrong(TYPE, TYPE + "\n    region: {q: [0, 1], q1: [0, 1]}", "nonlinearities[0].region.q1", "are the same"),
    wrong(
        TYPE,
        "  - type: {auto: {region: {q: [0, 1]}}}\n    region: {q: [0, 1]}",
        "nonlinearities[0].region",
        "given twice",
        place=(10, 5),
    ),
    wrong(TYPE, "  - type: {sector: {K2: [1, 2]}}", "nonlinearities[0].type.sector.K2", "1 column", "component of q"),
    wrong(
        TYPE, "  - type: {jacobian: [1, [1, 2]]}", "nonlinearities[0].type.jacobian[1]", "1 column", "component of q"
    ),
    wrong(TYPE, "  - type: {cocoercive: 0}", "nonlinearities[0].type.cocoercive", "give a number > 0"),
    wrong(
        TYPE,
        "  - type: {one-sided-lipschitz: {rho: auto, beta: 1, phi: 1}}",
        "nonlinearities[0].type.one-sided-lipschitz.rho",
        "cannot be auto; give a number",
    ),
    wrong(TYPE, "  - type: {lipschitz: 5}", "nonlinearities[0].type", "lipschitz 5 is refuted by q =", "|df| ="),
    wrong(TYPE, "  - type: {slope: [2, 1]}", "nonlinearities[0].type", "above the upper bound"),
    wrong(TYPE, "  - type: {slope: [-.inf, 1]}", "nonlinearities[0].type.slope[0]", "not a finite number"),
    wrong(TYPE, "  - type: {slope: [0, -.inf]}", "nonlinearities[0].type.slope[1]", "not a finite number"),
    wrong(TYPE, "  - type: {slope: [[0, 0], [1, 1]]}", "nonlinearities[0].type", "as many of each"),
    wrong(TYPE, "  - type: {multiplier: [[0, 1], [2, 0]]}", "nonlinearities[0].type", "not symmetric"),
    wrong(TYPE, "  - type: {multiplier: [[0, 1, 0], [1, 0, 0]]}", "nonlinearities[0].type", "2 x 2"),
    wrong(TYPE, "  - type: q|q|", "nonlinearities[0].f", "differs from its type q|q|"),
    wrong(F, "    f: x1", "nonlinearities[0].f", "unknown name 'x1'"),
    wrong(F, "    f: q.real", "nonlinearities[0].f", "attributes are not allowed", place=(10, 9)),
    wrong(F, "    f: lambda q. q", "nonlinearities[0].f", "attributes are not allowed"),
    wrong(F, "    f: eval(q)", "nonlinearities[0].f", "unknown function 'eval'"),
    wrong(ALPHA, "  alpha: 0", "observer.alpha", "0 is not allowed; give a number > 0"),
    wrong(ALPHA, "  alpha: -b", "observer.alpha", "-b is not allowed; give a number > 0"),
    wrong(ALPHA, "  alpha: {min: 2, max: 1}", "observer.alpha", "min 2 is not below max 1"),
    wrong(ALPHA, "  alpha: {min: 0, max: 1}", "observer.alpha.min", "give a number > 0"),
    wrong(ALPHA, "  alpha: {min: 1, max: 2, points: 1}", "observer.alpha.points", "whole number from 2"),
    wrong(ALPHA, "  alpha: {min: 1, max: 2, points: 2.5}", "observer.alpha.points", "whole number from 2"),
    wrong(ALPHA, ALPHA + "\n  objective: pareto", "observer.alpha", "objective pareto needs a range"),
    wrong(ALPHA, ALPHA + "\n  objective: max-alpha", "observer.alpha", "objective max-alpha needs a range"),
    wrong(ALPHA, ALPHA + "\n  objective: {gamma: 0}", "observer.objective.gamma", "> 0"),
    wrong(ALPHA, ALPHA + "\n  slack: -0.1", "observer.slack", "give a number >= 0"),
    wrong(ALPHA, ALPHA + "\n  bounds: {P: 0}", "observer.bounds.P", "give a number > 0"),
    wrong(ALPHA, ALPHA + "\n  bounds: {L1: {frobenius: 0}}", "observer.bounds.L1.frobenius", "> 0"),
    wrong(DISTURBANCE, "disturbance: {sinusoid: {omega: 0}}", "disturbance.sinusoid.omega", "> 0"),
    wrong(
        DISTURBANCE + "\nperformance: x",
        "performance: w",
        "performance",
        "w1 is no function of the augmented",
    ),
    wrong(HORIZON, "  horizon: 0", "simulation.horizon", "give a number > 0"),
    wrong(HORIZON, HORIZON + "\n  points: 1000001", "simulation.points", "whole number from 2 to 1000000"),
    wrong(HORIZON, HORIZON + "\n  seed: -1", "simulation.seed", "whole number from 0"),
    wrong(HORIZON, HORIZON + "\n  noise: {amplitude: -1, period: 1}", "simulation.noise.amplitude", ">= 0"),
    wrong(HORIZON, HORIZON + "\n  noise: {amplitude: 1, period: 1e-9}", "simulation.noise.period", "periods"),
    wrong(W, "  w: [sin(t)]\n  v: [0]", "simulation.v", "w is given already"),
    wrong(X0, "  x0: [1, 0, 2]", "simulation.x0", "the disturbance model begins at [2.0]", "w is given"),
    wrong(X0, "  x0: {x1: 1, w1: 2}", "simulation.x0", "the disturbance model begins at [2.0]", "give one of both"),
    wrong(W, "  w: [sin(s)]", "simulation.w[0]", "unknown name 's'", place=(21, 11)),
    wrong(W, "  v: [x1]", "simulation.v[0]", "unknown name 'x1'"),
    wrong(STATUS, "  limit.gamma: .nan", "expect.limit.gamma", "not a finite number"),
]

OTHER_TONGUES = [  # what is written so elsewhere is told in what is written here
    wrong(A, "  A: [0 1; -1 0]", "system.A", "write [[0, 1], [-1, 0]]", place=(4, 6)),
    wrong(A, "  A: [0, 1; -1, 0]", "system.A", "write [[0, 1], [-1, 0]]"),
    wrong(A, "  A: [0 1; -1 -b/2]", "system.A", "write [[0, 1], [-1, -b/2]]"),
    wrong(B, "  B: [0; 1]", "system.B", "write [[0], [1]]"),
    wrong(C, "  C: [1 0]", "system.C", "write [[1, 0]]"),
    wrong(F, "    f: tanh(50*x2)", "nonlinearities[0].f", "unknown name 'x2'", "f is a function of q", "q = x2"),
    wrong("  type: l2", "  type: hinf", "observer.type", "is called l2 here"),
    wrong("  type: l2", "  type: H_infinity", "observer.type", "is called l2 here"),
    wrong("  type: l2", "  type: Kalman", "observer.type", "is called ekf here", "l2 bounds the gain"),
    wrong("  type: l2", "  type: Luenberger", "observer.type", "is l2 here"),
    wrong("  type: l2", "  type: high gain", "observer.type", "did you mean high-gain"),
    wrong(
        DISTURBANCE, "disturbance: integrater", "disturbance", "integrator?", "{sinusoid: {omega: ..}}", "{model: ..}"
    ),
    wrong(DISTURBANCE, "disturbance: constant", "disturbance", "is called integrator here"),
    wrong(DISTURBANCE, "disturbance: sine", "disturbance", "{sinusoid: {omega: ..}}"),
    wrong(DISTURBANCE, "disturbance: [{type: integrator}]", "disturbance[0].type", "write [integrator, unknown, ..]"),
    wrong(
        TYPE, "  - type: foo", "nonlinearities[0].type", "allowed: monotone, q|q|", "auto, {lipschitz: ..}, {slope: ..}"
    ),
    wrong(ALPHA, ALPHA + "\n  objective: foo", "observer.objective", "feasibility, pareto, {gamma: ..}"),
    wrong(
        HORIZON,
        "  horizon: 500 ms",
        "simulation.horizon",
        "a number has no unit, found 500 ms; write 0.5 for so many s",
    ),
    wrong(HORIZON, "  horizon: 10 V", "simulation.horizon", "write 10 for so many V"),
    *(
        wrong(ALPHA, f"  alpha: {quantity}", "observer.alpha", f"found {quantity}; write {written}")
        for quantity, written in {
            "10 kOhm": "10000 for so many Ohm",
            "200 mA": "0.2 for so many A",
            "50 cm": "0.5 for so many m",
            "5 mg": "5e-06 for so many kg",
            "10 µs": "1e-05 for so many s",
            "30 deg": "30*pi/180 for so many rad",
            "10dB": "10**(10/20) for a ratio of amplitudes",
            "200%": "200/100",
            "2 1/s": "2 for so many 1/s",
            "1 rad/s": "1 for so many rad/s",
            "36 km/h": "10 for so many m/s",
            "2 mm^2": "2e-06 for so many m^2",
            "5 furlong": "it in the unit of your spec, without the unit",
        }.items()
    ),
    wrong(ALPHA, "  alpha: 2b", "observer.alpha", "expected an operator but found 'b'"),
    wrong(W, "  w: [10 mA]", "simulation.w[0]", "write 0.01 for so many A"),
    wrong(ALPHA, "  alpha: 9,81", "observer.alpha", "a decimal point is a point", "write 9.81"),
    wrong(PARAMETERS, "parameters: {b: 0.5, g: 9,81}", "parameters.81", "a decimal point is written as a point"),
    wrong(A, "  A: eye(2)", "system.A", "a matrix is a list of its rows, without quotes: write [[1, 0], [0, 1]]"),
    wrong(B, "  B: eye(2)", "system.B", "a matrix is a list of its rows, without quotes: write [[1, 0], [0, 1]]"),
    wrong(B, "  B: [0 1]'", "", "no transpose", "[[0], [1]]", place=(5, 11)),
    wrong(W, "  w: [step(t)]", "simulation.w[0]", "a step at t = 1 is written (t >= 1)"),
    wrong(W, "  w: [heaviside(t - 1)]", "simulation.w[0]", "(t >= 1)"),
    wrong(
        W,
        "  w: data/w1.csv",
        "simulation.w",
        "a file goes with a signal: write w: {NAME: {file: data/w1.csv, column: ..}}",
    ),
    wrong(
        W,
        "  w: {file: w1.csv, column: w}",
        "simulation.w",
        "a file goes with a signal: write w: {w1: {file: .., column: ..}}",
    ),
    wrong(A, "  Ts: 0.1\n" + A, "system.Ts", "is called period here: write time: discrete, and period: in s"),
    wrong(TYPE, "  - type: {slope: [0, 1]}", "nonlinearities[0].type", "is refuted by", "region: {q: [lo, hi]}"),
    wrong(
        TYPE + "\n" + F,
        "  - type: {slope: [0, 3]}\n    f: q*y1",
        "nonlinearities[0].type",
        "if q or y1 cannot have that value, declare where it stays: region: {y1: [lo, hi]}",
    ),
    wrong(
        TYPE + "\n" + F,
        "  - type: {lipschitz: auto}\n    f: sqrt(q)\n    region: {q: [0, 2]}",
        "nonlinearities[0].type",
        "df/dq cannot be bounded above at q in [0, ",
    ),
    wrong(
        TYPE + "\n" + F,
        "  - type: {lipschitz: auto}\n    f: -sqrt(q)\n    region: {q: [0, 2]}",
        "nonlinearities[0].type",
        "df/dq cannot be bounded below at q in [0, ",
    ),
]

YAML = [
    wrong(C, "  C: [[1, 0]", "", "not valid YAML"),
    wrong(C, "\tC: [[1, 0]]", "", "a tab cannot indent YAML"),
    wrong(C, C + "\n" + A, "system.A", "duplicate key A; it is given in line 4 already", place=(7, 3)),
    wrong(C, C + "\n  <<: {D: 1}", "system.<<", "merge keys"),
    wrong(C, C + "\n  1: 2", "system.1", "a key must be text, found 1"),
    wrong(C, C + "\n  ? [a]\n  : 1", "system", "a key must be text, found a list or a mapping"),
    wrong(C, "  C: !!python/object/apply:os.system [ls]", "system.C", "tag", "is not read"),
    wrong(C, "  C: !!binary aGVsbG8=", "system.C", "tag", "is not read"),
    wrong(C, "  C: &c [*c]", "system.C[0]", "stands inside what it stands for"),
    wrong(C, "  C: *c", "system.C", "the alias *c has no anchor"),
    wrong(C, C + "\n---\nobsdesign: 1", "", "a second document begins here"),
    wrong(C, f"  C: {'[' * 40}1{']' * 40}", "system.C[0][0]", "nested deeper than 32 levels"),
    wrong(C, "  C: \x01", "", "U+0001"),
    wrong(C, "  C: \0", "", "U+0000"),
]


def test_a_whole_w_without_a_model_is_answered_once():
    text = BASE.replace(B, "  B: [[0, 0], [1, 1]]").replace(D, "  D: [[b, 0]]").replace(W, "  w: [sin(t), 0]")
    (problem,) = problems_of(text.replace(DISTURBANCE + "\n", "").replace(PERFORMANCE, "performance: w"))
    assert problem.message.startswith(
        "each of w1, w2 is no function of the augmented state; give it a disturbance model"
    )


def test_the_spec_that_the_wrong_ones_are_made_from_is_right():
    assert loads(BASE).plant.n == 2


@pytest.mark.parametrize("case", [*SHAPES, *FORMS, *VALUES, *OTHER_TONGUES, *YAML])
def test_a_wrong_spec_is_answered_at_its_place_with_what_is_allowed(case):
    problems = problems_of(case.text)
    (problem, *_) = [p for p in problems if p.key == case.key] or pytest.fail("\n".join(map(str, problems)))
    assert case.is_answered_by(problem)


@pytest.mark.parametrize("case", [*SHAPES, *FORMS, *VALUES, *OTHER_TONGUES, *YAML])
def test_one_mistake_gives_one_line(case):
    problems = [p for p in problems_of(case.text) if p.message != "is required" or p.key == case.key]
    assert len(problems) == 1, "\n".join(map(str, problems))


def test_all_errors_of_a_file_are_found_at_once_in_the_order_of_the_file():
    text = (
        BASE.replace(A, "  A: [[0, oops], [-1, 0], [0, 0]]")
        .replace(B, "  B: [[0], [1/0]]")
        .replace(F, "    f: q**3 + x1")
        .replace(DISTURBANCE, "disturbance: {sinusoid: {omega: -1}}")
        .replace(ALPHA, "  alpha: 0\n  objektive: min-gamma")
        .replace(HORIZON, "  horizon: -1")
        .replace(W, "  w: [sin(tt)]")
        .replace(STATUS, "  status: sertified")
    )
    problems = problems_of(text)
    assert [p.key for p in problems] == [
        "system.A",
        "system.A[0][1]",
        "system.B[1][0]",
        "nonlinearities[0].f",
        "disturbance.sinusoid.omega",
        "observer.objektive",
        "simulation.horizon",
        "simulation.w[0]",
        "expect.status",
    ]
    assert [(p.line, p.column) for p in problems] == sorted((p.line, p.column) for p in problems)


def test_structural_errors_of_several_sections_are_found_together_with_wrong_values_of_the_others():
    text = BASE.replace(TYPE, "  - typ: monotone").replace(DISTURBANCE, "disturbance: integrator\nfoo: 1")
    text = text.replace(A, "  A: [[1, 2, 3]]").replace(ALPHA, "  alpha: -1").replace(C, "  C: {}")
    keys = [p.key for p in problems_of(text)]
    assert keys == ["system.C", "nonlinearities[0].typ", "foo", "observer.alpha"]


def test_a_message_is_one_line_with_file_line_column_key_what_is_wrong_and_what_is_allowed():
    (problem,) = problems_of(BASE.replace(ALPHA, "  aplha: 0.5"))
    assert str(problem) == (
        "spec.yaml:17:3: observer.aplha: unknown key aplha; did you mean alpha? "
        "allowed: type, rho, estimate, poles, L2, alpha, objective, slack, bounds, gains, reconstruct [OBS201]"
    )


def test_of_disturbance_and_noise_together_what_has_a_state_is_advised():
    text = BASE.replace(B, "  B: [[0, 0], [1, 0]]").replace(D, "  D: [[0, b]]").replace(W, "  w: [sin(t), 0]")
    text = text.replace(DISTURBANCE, "disturbance: [integrator, unknown]").replace(PERFORMANCE, "performance: w")
    (problem,) = problems_of(text)
    assert problem.message == "w2 is no function of the augmented state; name the rest: [w1]"


def test_very_many_errors_end_in_a_last_line():
    text = BASE.replace(A, f"  A: [{', '.join(f'[oops{i}, 1]' for i in range(300))}]")
    problems = problems_of(text)
    assert len(problems) == 101
    assert problems[-1].message == "and more"


def test_a_state_may_not_have_the_name_of_a_state_of_the_disturbance_model():
    text = BASE.replace(A, "  states: [x1, dw1]\n" + A).replace("performance: x", "performance: w")
    (problem,) = problems_of(text.replace("integrator", "double-integrator"))
    assert (problem.key, problem.message[:40]) == ("disturbance", "dw1 names a state of the disturbance mod")


def test_an_unknown_name_is_told_once_with_its_other_places():
    text = BASE.replace(A, f"  A: [{', '.join(['[oops, oops]'] * 300)}]")
    (problem,) = [one for one in problems_of(text) if one.id == "OBS302"]
    assert problem.message.startswith("unknown name 'oops'; ")
    line, column = problem.line, problem.column
    assert f"; also at {line}:{column + 6}, {line}:{column + 14}, " in problem.message
    assert problem.message.endswith(" and 92 more")  # of the hundred that are told of a file


@pytest.mark.parametrize(
    ("system", "said"),
    [
        ("A: [[0, 1], [-1, -1]], B: [0, 1, 2]", "B: expected 2 rows (one for each state), found a vector of 3"),
        ("A: [[0, 1], [-1, -1, 3]], B: [0, 1]", "A[1]: expected a row of 2 like the others, found a row of 3"),
        ("A: [[0, 1, 0], [-1, -1, 0]], B: [0, 1]", "A: expected a square matrix, found 2x3"),
    ],
)
@pytest.mark.usefixtures("here")
def test_a_wrong_matrix_makes_no_other_one_wrong(system, said):
    text = f"obsdesign: 1\nsystem: {{{system}, C: [1, 0]}}\nobserver: {{type: l2, alpha: 0.1}}\n"
    Path("spec.yaml").write_text(text)
    outcome = run("check", "spec.yaml")
    assert outcome.exit_code == 2
    (line,) = outcome.stderr.splitlines()
    assert line.endswith(f": system.{said} [OBS209]")
