"""Plants in discrete time with known limits of gamma, as the text of specs."""

from textwrap import dedent

COLUMN = {
    "K1": """
        system: {time: discrete, A: [[.9, .1, 0], [-.1, .8, .2], [0, -.2, .7]], C: [[1, 0, 0]],
                 B: [[.1, 0], [0, 0], [.2, 0]], D: [[0, .1]]}
        nonlinearities:
          - {type: {slope: [0, 1]}, Bf: [0, .2, 0], Cq: [0, 1, 0]}
          - {type: {lipschitz: .5}, Bf: [0, 0, .3], Cq: [0, 0, 1]}
        """,
    "K2": """
        system: {time: discrete, A: [[.8, .2, 0], [0, .7, .1], [-.1, 0, .5]], C: [[1, 0, 0], [0, 0, 1]],
                 B: [[.1, 0, 0], [.1, 0, 0], [0, 0, 0]], D: [[0, .1, 0], [0, 0, .1]]}
        nonlinearities:
          - type: {jacobian: [[[-1, 0], [0, 0]], [[-1, 0], [1, 1]], [[1, 0], [0, 0]], [[1, 0], [1, 1]]]}
            Bf: [[.1, 0], [.3, 0], [0, .2]]
            Cq: [[1, 0, 0], [0, 1, 0]]
        performance: {H: [[0, 1, 0]]}
        """,
    "K3": """
        system: {time: discrete, period: .1, A: [[1, .1], [0, .95]], C: [[1, 0]], B: [[0, 0], [.1, 0]], D: [[0, .05]]}
        nonlinearities: [{type: sin, Bf: [0, -.1], Cq: [1, 0]}]
        disturbance: [integrator, unknown]
        performance: {H: [[0, 0, 1]]}
        """,
    "K5": """
        system: {time: discrete, A: [[.9, .2], [-.2, .6]], C: [[1, 0]], B: [[.1, 0], [.05, 0]], D: [[0, .1]]}
        nonlinearities:
          - {type: {slope: [0, 2]}, Bf: [.1, .2], Cq: [.3, 1], Dqf: [[-.4]], Dq: [[.1, 0]], Df: [.2]}
        """,
    "K6": """
        system: {time: discrete, A: [[.7, .3], [-.3, .7]], C: [[1, 0]], B: [[.1, 0], [.1, 0]], D: [[0, .1]]}
        nonlinearities:
          - type: {one-sided-lipschitz: {rho: -.2, beta: 1, phi: 0}}
            Bf: [[.2, 0], [0, .2]]
            Cq: [[1, 0], [0, 1]]
        """,
    "K7": """
        system:
          time: discrete
          A: [[1, .01, 0, 0], [-.486, .9875, .486, 0], [0, 0, 1, .01], [.195, 0, -.195, 1]]
          C: [[1, 0, 0, 0], [0, 1, 0, 0]]
          B: [[0, 0, 0], [.01, 0, 0], [0, 0, 0], [.01, 0, 0]]
          D: [[0, .01, 0], [0, 0, .1]]
        nonlinearities: [{type: {lipschitz: 3.33}, Bf: [0, 0, 0, -.01], Cq: [0, 0, 1, 0]}]
        """,
    "K8": """
        system: {time: discrete, A: [[1, .1, 0], [0, 1, .1], [0, 0, 1]], C: [[1, 0, 0], [0, 1, 0]],
                 B: [[0, 0, 0], [0, 0, 0], [.1, 0, 0]], D: [[0, .01, 0], [0, 0, .01]]}
        nonlinearities: [{type: "q|q|", f: q*abs(q), Bf: [0, .1, 0], Cq: [0, 0, 1]}]
        performance: {H: [[0, 0, 1]]}
        """,
    "R1": """
        system: {time: discrete, A: [[.9, .2, 0], [-.1, 1.05, .1], [0, .1, .6]], C: [[1, 0, 0]],
                 B: [[.1, 0], [0, 0], [.2, 0]], D: [[0, .3]]}
        """,
    "R2": """
        system: {time: discrete, A: [[.9, .2, 0], [-.1, 1.05, .1], [0, .1, .6]], C: [[1, 0, 0]],
                 B: [[.1, .05], [0, .1], [.2, 0]], D: [[.1, .3]]}
        """,
    "R3": """
        system: {time: discrete, A: [[.9, .2, 0], [-.1, 1.05, .1], [0, .1, .6]], C: [[1, 0, 0]],
                 B: [[.1, 0], [0, 0], [.2, 0]], D: [[0, .3]]}
        nonlinearities: [{type: {lipschitz: L}, Bf: [0, 0, .2], Cq: [0, 1, 0]}]
        """,
    "Q1": """
        system: {time: discrete, A: [[1, .1], [-.2, .9]], C: [[1, 0]], B: [[0, 0], [.1, 0]], D: [[0, .05]]}
        nonlinearities: [{type: sat, Bf: [0, -.1], Cq: [0, 1]}]
        performance: {H: [[0, 1]]}
        """,
}


def implicit_euler() -> str:
    """K4: a friction without an upper slope, by implicit Euler with steps of .1 s."""
    det = 1 + 0.1 * 0.1 + 0.1 * 0.1
    S = [[(1 + 0.1 * 0.1) / det, 0.1 / det], [-0.1 / det, 1 / det]]
    b1, b2 = 0.1 * S[0][1], 0.1 * S[1][1]
    return f"""
        system: {{time: discrete, A: {S}, C: [[1, 0]], B: [[{b1!r}, 0], [{b2!r}, 0]], D: [[0, .1]]}}
        nonlinearities: [{{type: monotone, Bf: [{-b1!r}, {-b2!r}], Cq: {S[1]}, Dqf: [[{-b2!r}]], Dq: [[{b2!r}, 0]]}}]
        """


def text(name: str, observer: str, **values: object) -> str:
    """Text of a spec: one of the plants with an observer; values take the place of their names in it."""
    plant = implicit_euler() if name == "K4" else COLUMN[name]
    for key, value in values.items():
        plant = plant.replace(f" {key}}}", f" {value}}}")
    return f"obsdesign: 1\nname: {name}\n{dedent(plant).strip()}\nobserver: {{{observer}}}\n"
