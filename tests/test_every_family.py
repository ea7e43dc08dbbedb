"""What every family of observers owes to the rest: a new one inherits all of it by its entry in SMALL."""

import copy
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.contract import broken_rules, differences, read
from support.forging import at, put, scaled
from support.forging import claiming as claiming_in_words
from support.sweep import examples

import obsdesign as od
from obsdesign.families import FAMILIES
from obsdesign.lmi.formula import printed

PLANT = {
    "system": {"A": [[0, 1], [-2, -1]], "B": [[0, 0], [1, 0]], "C": [[1, 0]], "D": [[0, 0.2]]},
    "nonlinearities": [{"f": "0.5*sin(q)", "type": {"lipschitz": 0.5}, "Bf": [[0], [1]], "Cq": [[1, 0]]}],
    "performance": {"H": [[1, 0], [0, 0.5]]},
    "simulation": {"horizon": 8, "x0": [1, -0.5], "w": ["sin(t)", "cos(3*t)"], "points": 21},
}
NOISELESS = {"system": {"A": [[0, 1], [-2, -1]], "B": [[0], [1]], "C": [[1, 0]]}, "simulation": {"w": ["sin(t)"]}}
UNSTABLE = {"system": {"A": [[1, 0], [0, -1]], "C": [[0, 1]]}}  # nothing is seen of the first state
SUPPLIES = {"mu", "mu1", "mu2"}  # what proves gamma: a witness beside it
LEVELS = {"gamma", "w", "w_rate", "x_rate"}  # what says the less the larger it is
RATES, TIMES = ("alpha", "decay", "delta"), ("T1", "T2")  # keys that have the unit 1/s, or s


@dataclass(frozen=True)
class Small:
    """A small spec of a family, and what is known of it.

    Attributes
    ----------
    observer
        Its section of this name.
    plant
        Keys of sections that differ from PLANT.
    raised
        Changes of the observer's section with the numbers of a claim that says so: more than any gain achieves.
    read
        Keys of `observer` in a result file that a proof reads beside the gains.
    optional
        Keys of `guarantee` without which a file claims less, and no more than is proved.
    told
        Keys without which a file claims less than its statement.
    uncovered
        Changes after which the gains are proved for another plant only.
    hopeless
        Changes after which there is no solution.
    scalable
        Whether its limit is positive without the bounds of the observer's section.
    same
        How near its limit is in other units, relative: a descent ends elsewhere in them.
    """

    observer: Mapping[str, Any]
    plant: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    raised: tuple[tuple[Mapping[str, Any], Mapping[str, Any]], ...] = ()
    read: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    uncovered: Mapping[str, Any] | None = None
    hopeless: Mapping[str, Mapping[str, Any]] = field(default_factory=lambda: UNSTABLE)
    scalable: bool = True
    same: float = 1e-4

    def sections(self, **changes):
        """Sections of the spec, with some keys of some of them changed."""
        made = {**PLANT, "observer": self.observer}
        for part in (self.plant, changes):
            for name, keys in part.items():
                made[name] = {**made.get(name, {}), **keys} if isinstance(keys, Mapping) else keys
        if "D" in made["system"] and len(made["system"]["B"][0]) != len(made["system"]["D"][0]):
            del made["system"]["D"]
        return copy.deepcopy(made)


LOOP = [{**PLANT["nonlinearities"][0], "type": {"slope": [-0.5, 0.5]}, "Dqf": 0.2, "Dq": [[0, 0.1]]}]  # q of f and w
TWO = [*PLANT["nonlinearities"], {"f": "0.2*sin(q)", "type": {"lipschitz": 0.2}, "Bf": [[0], [1]], "Cq": [[0, 1]]}]
TANK = {
    "system": {"A": [[-1, 0.3], [0.2, -2]], "B": [[1], [0.5]], "C": [[1, 0]], "D": [[0.1]]},
    "nonlinearities": [
        {"f": "sin(q)", "type": {"slope": [-1, 1]}, "Bf": [[0.3], [0.5]], "Cq": [[0.3, 1]], "Dqf": 0.2, "Dq": 0.1},
    ],
    "simulation": {"w": ["sin(t)"]},
}
ALL = [{"f": ["0.3*sin(q1)", "0.3*sin(q2)"], "type": {"lipschitz": 0.3}, "Bf": np.eye(2), "Cq": np.eye(2)}]
FASTER = ({"alpha": 40}, {"alpha": 40})
SEEN = {  # w1 acts on the speed, which is measured
    "system": {
        "A": [[0, 1], [-2, -1]],
        "B": [[0.1, 0, 0], [1, 0, 0]],
        "C": [[1, 0], [0, 1]],
        "D": [[0, 0.2, 0], [0, 0, 0.1]],
    },
    "simulation": {"w": ["sin(t)", "cos(3*t)", "0.5*sin(2*t)"], "horizon": 3},
}
LATE = {"system": {"B": [[0, 0, 0], [1, 0, 0]], "C": [[1, 0], [1, 0]]}}  # C B = 0
SMALL = {
    "l2": (
        Small({"type": "l2", "alpha": 0.2, "L2": 0}, {"nonlinearities": LOOP}, raised=(FASTER,)),
        Small(
            {"type": "l2", "alpha": 0.1, "L2": 0.1, "bounds": {"L1": 20}},
            {"disturbance": "integrator", "performance": {"H": [[1, 0, 0], [0, 0.5, 0]]}, **NOISELESS},
            raised=(FASTER,),
            hopeless={"observer": {"alpha": 1000}},
            scalable=False,
        ),
        Small(
            {"type": "l2", "alpha": 0.2, "poles": {"radius": 9, "damping": 0.6}},
            {"nonlinearities": LOOP},
            raised=(FASTER,),
            hopeless={"observer": {"poles": {"radius": 0.5}}},
            scalable=False,
        ),
    ),
    "linf": (
        Small(
            {"type": "linf", "alpha": 0.3, "L2": 0},
            {"nonlinearities": LOOP},
            raised=(FASTER,),
            hopeless={"observer": {"objective": {"gamma": 0.1}}},
        ),
        Small(
            {"type": "linf", "alpha": 0.5, "reconstruct": "w", "bounds": {"L1": 20}},
            TANK,
            raised=(FASTER,),
            scalable=False,
            optional=("reconstruction",),
        ),
        Small(
            {"type": "linf", "alpha": 0.3},
            {"nonlinearities": LOOP, "implementation": {"period": 0.1, "method": "euler", "impose": True}},
            raised=(FASTER,),
            scalable=False,
        ),
    ),
    "sporadic": (
        Small(
            {"type": "sporadic", "T1": 0.1, "T2": 0.2, "decay": 0.05, "delta": 3},
            NOISELESS,
            raised=(({"T2": 3}, {"T2": 3}), ({"decay": 8}, {"decay": 8})),
            read=("T1", "T2", "delta"),
        ),
        Small(
            {
                **{"type": "sporadic", "T1": 0.1, "T2": 0.2, "decay": 0.05, "relaxation": "proposition-2"},
                "gains": {"L": [1.5, 0.5], "H": -1.5},
            },
            NOISELESS,
            raised=(({"T2": 3}, {"T2": 3}),),
            read=("T1", "T2", "delta"),
            optional=("T2_max",),
            hopeless={"observer": {"decay": 50, "delta": 150, "gains": None}},
            scalable=False,
        ),
        Small(
            {"type": "sporadic", "T1": 0.1, "T2": 0.2, "decay": 0.05},
            NOISELESS,
            raised=(({"T2": 3}, {"T2": 3}), ({"decay": 8}, {"decay": 8})),
            read=("T1", "T2"),
            told=("energy",),
            same=0.02,
        ),
        Small(
            {"type": "sporadic", "T1": 0, "T2": 0.2, "injection": "reset", "bounds": {"K": 3}},
            NOISELESS,
            raised=(({"T2": 3}, {"T2": 3}), ({"decay": 8}, {"decay": 8})),
            read=("T1", "T2"),
            scalable=False,
            told=("energy",),
        ),
    ),
    "lipschitz": (
        Small(
            {"type": "lipschitz", "objective": "min-gamma", "decay": 0.05},
            {"nonlinearities": TWO},
            raised=(({"decay": 40}, {"alpha": 40}),),
            optional=("admissible",),
        ),
        Small(
            {"type": "lipschitz", "decay": 0.05, "bounds": {"L": 20}},
            {"nonlinearities": ALL},
            raised=(({}, {"lipschitz": 3}),),
            uncovered={"nonlinearities": [{"type": {"lipschitz": 9}, **{k: ALL[0][k] for k in ("f", "Bf", "Cq")}}]},
        ),
        Small(
            {"type": "lipschitz", "objective": "min-gamma", "decay": 0.05, "poles": {"damping": 0.5}},
            {"nonlinearities": TWO, "implementation": {"period": 0.1, "method": "rk4", "impose": True}},
            raised=(({"decay": 40}, {"alpha": 40}),),
            optional=("admissible",),
            hopeless={"observer": {"poles": {"radius": 0.3}}},
            scalable=False,
        ),
    ),
}
SMALL["unknown-input"] = (
    Small(
        {"type": "unknown-input", "alpha": 0.2},
        {**SEEN, "nonlinearities": [{**LOOP[0], "Dq": [[0, 0.1, 0]]}]},
        raised=(FASTER,),
        hopeless=LATE,
    ),
)
CASES = [pytest.param(case, id=f"{name}-{i}") for name, cases in SMALL.items() for i, case in enumerate(cases)]
every_case = pytest.mark.parametrize("case", CASES)


@cache
def solved(name, i):
    return od.solve(od.Spec(name=f"{name} {i}", **SMALL[name][i].sections()))


def design_of(case):
    """Design of a small spec, solved once."""
    name = case.observer["type"]
    return solved(name, SMALL[name].index(case))


def test_every_family_is_held_to_its_contract():
    assert SMALL.keys() == {name for name, family in FAMILIES.items() if not family.equations}
    assert all(case.observer["type"] == name for name, cases in SMALL.items() for case in cases)


# What is written is read


@every_case
def test_a_claim_is_read_as_it_was_written(case, tmp_path):
    design = design_of(case)
    assert design.status == "certified"
    design.save(tmp_path / "gains.json")
    again = od.read(tmp_path / "gains.json", design.spec)
    assert list(differences(again.claim, design.claim)) == []
    assert list(differences(again.gains, design.gains)) == []
    assert again.result == design.result
    proof = od.verify(tmp_path / "gains.json", design.spec)
    assert (proof.claim, proof.checks) == (design.claim.headline(design.spec), design.claim.checks)
    assert proof.holds
    assert design.verify() == proof


@every_case
def test_a_result_keeps_the_rules_of_its_format(case, tmp_path):
    design = design_of(case)
    design.save(tmp_path / "gains.json")
    result = read((tmp_path / "gains.json").read_text())
    assert broken_rules(result, design.gains) == []
    assert result["observer"]["type"] == case.observer["type"]


SPORADIC = {"type": "sporadic", "T1": 0.1, "T2": 0.2, "decay": 0.05, "delta": 3}
RANGED = {"alpha": {"min": 0.05, "max": 3, "points": 4}}
SEARCHES = {  # observer, kind of its limit, and where it is
    "proposition-3": ({**SPORADIC, "relaxation": "proposition-3"}, "best-found", None),
    "proposition-4": ({**SPORADIC, "relaxation": "proposition-4"}, "best-found", None),
    "proposition-2": (SPORADIC, "infimum", None),
    "delta": ({**SPORADIC, "delta": None, "relaxation": "proposition-2"}, "best-found", None),
    "clock": ({**SPORADIC, "delta": None}, "best-found", None),
    "reset": ({**SPORADIC, "delta": None, "injection": "reset", "bounds": {"K": 3}}, "best-found", None),
    "T2": ({**SPORADIC, "objective": "max-T2", "T2": {"min": 0.1, "max": 1}}, "infimum", None),
    "curves": (
        {
            **SPORADIC,
            "objective": "pareto",
            "T2": {"min": 0.1, "max": 0.3, "points": 3},
            "relaxation": ["proposition-2", "proposition-3", "proposition-4"],
        },
        "infimum",
        {"T2"},
    ),
    "linf pareto": ({"type": "linf", **RANGED, "objective": "pareto"}, "best-found", {"alpha"}),
    "linf": ({"type": "linf", **RANGED}, "best-found", {"alpha"}),
    "l2 pareto": ({"type": "l2", **RANGED, "objective": "pareto"}, "infimum", {"alpha"}),
    "l2": ({"type": "l2", "alpha": 0.2}, "infimum", None),
    "given": ({"type": "l2", "alpha": 0.2, "gains": {"L1": [-1, 0], "L2": 0}}, "infimum", None),
    "weight": ({"type": "lipschitz", "objective": "pareto", "weight": 0.5}, "best-found", None),
    "weights": (
        {"type": "lipschitz", "objective": "pareto", "weight": {"min": 0.1, "max": 0.9, "points": 3}},
        "best-found",
        {"weight", "decay"},
    ),
    "compare": ({"type": "lipschitz", "objective": "min-gamma", "relaxation": "compare"}, "infimum", None),
}


@pytest.mark.parametrize(("observer", "kind", "at"), SEARCHES.values(), ids=SEARCHES)
def test_nothing_is_shipped_that_is_better_than_its_limit_and_that_says_what_it_is(observer, kind, at):
    plant = NOISELESS if FAMILIES[observer["type"]].sampled else {}
    made = Small(observer, plant).sections()
    design = od.solve(od.Spec(name="searched", **made))
    assert design.status == "certified"
    assert broken_rules(json.loads(design.text()), design.gains) == []
    limit = design.result["guarantee"]["limit"]
    assert (limit.get("kind", "infimum"), limit.get("at", {}).keys()) == (kind, at or set())
    assert (kind == "best-found") == ("the best that was found" in dict(design.table())["limit"])


@every_case
def test_the_same_spec_gives_the_same_bytes(case):
    def timeless(design):
        result = copy.deepcopy(design.result)
        del result["created"], result["solver"]["time_s"]
        return json.dumps(result)

    first = design_of(case)
    assert timeless(od.solve(od.Spec(name=first.spec.name, **case.sections()))) == timeless(first)


@every_case
def test_a_design_shows_itself(case):
    design = design_of(case)
    named = replace(design, spec=replace(design.spec, name="<b> & co"))
    assert "certified" in str(named)
    assert "<b> & co" in str(named)
    assert "&lt;b&gt; &amp; co" in named._repr_html_()
    assert "<b>" not in named._repr_html_()


# A changed number never proves


def claiming(claim, **numbers):
    """A claim with other numbers, wherever they stand in it."""
    own = {f.name: f for f in fields(claim)}
    inner = {k: claiming(getattr(claim, k), **numbers) for k in ("certificate", "family") if k in own}
    if "witnesses" in own:
        inner["witnesses"] = {name: witnessing(witness, **numbers) for name, witness in claim.witnesses.items()}
        inner["stated"] = {k: printed(numbers[k]) if k in numbers else x for k, x in claim.constants.items()}
    return replace(claim, **inner, **{k: printed(x) for k, x in numbers.items() if k in own and k not in inner})


def witnessing(witness, mu=None, T2=None, decay=None, **_):
    """A witness by the time left to the next measurement for other numbers."""
    theorem, clock = witness.theorem, witness.theorem.clock
    longer = 1 if T2 is None else printed(T2) / clock.knots[-1]
    clock = replace(clock, knots=tuple(longer * knot for knot in clock.knots))
    rate = theorem.decay if decay is None else printed(decay)
    numbers = {k: printed(mu) if k == "mu" and mu is not None else x for k, x in witness.numbers.items()}
    return replace(witness, theorem=replace(theorem, clock=clock, decay=rate), numbers=numbers)


def with_claim(design, spec, **numbers):
    """The design with a claim of other numbers, of a spec that may ask for them; of its analysis nothing is proved."""
    forged = replace(design, spec=spec, claim=claiming(design.claim, **numbers))
    forged.__dict__["analysis"] = design.analysis
    return forged


@every_case
def test_a_gamma_below_the_limit_is_not_proved_even_with_the_words_and_levels_of_it(case):
    design = design_of(case)
    least = (design.limit_bounded or design.limit).get("gamma", 0) or design.guarantee.gamma / 100
    for factor in (0.9, 0.5, 1e-3):
        gamma = Fraction(f"{factor * least:.3g}")
        square = float(gamma * gamma)
        proof = with_claim(design, design.spec, gamma=float(gamma), mu=square, mu2=square).verify()
        assert f"gamma {float(gamma):g}, " in proof.claim
        assert not proof.holds
        assert not holds(with_claim(design, design.spec, gamma=float(gamma)))


@every_case
@examples(10)
@given(data=st.data())
def test_below_the_limit_no_other_gain_or_witness_helps(case, outcome_of, data):
    design = design_of(case)
    least = (design.limit_bounded or design.limit).get("gamma", 0) or design.guarantee.gamma / 100
    gamma = Fraction(f"{data.draw(st.floats(1e-3, 0.9)) * least:.3g}")
    square = float(gamma * gamma)
    forged = copy.deepcopy(with_claim(design, design.spec, gamma=float(gamma), mu=square, mu2=square).result)
    places = [*storages(forged["certificate"]), *(("observer", name) for name in (*design.gains, *case.read))]
    for place in data.draw(st.lists(st.sampled_from(places), min_size=1, max_size=3)):
        scaled(forged, place, data.draw(st.fractions(-3, 3, max_denominator=20)))
    assert outcome_of(forged).exit_code in {2, 4}


def holds(design):
    """Whether a claim is proved; one whose numbers do not belong to each other is refused."""
    try:
        return design.verify().holds
    except od.UsageError:
        return False


@every_case
def test_more_than_gains_achieve_is_not_proved_even_where_the_spec_asks_for_it(case):
    design = design_of(case)
    for asked, claimed in case.raised:
        assert not holds(with_claim(design, od.Spec(**case.sections(observer=asked)), **claimed))


@every_case
@pytest.mark.parametrize(("section", "keys"), [("system", ("B", "D")), ("nonlinearities", ("Bf",))])
def test_a_claim_of_one_plant_is_not_proved_of_another(case, section, keys):
    design, sections = design_of(case), case.sections()
    part = sections[section][0] if section == "nonlinearities" else sections[section]
    part |= {key: 1000 * np.array(part[key]) for key in keys if key in part}
    other = replace(design, spec=od.Spec(**sections))
    assert not other.verify().holds


@every_case
@pytest.mark.parametrize("factor", ["0.9", "1.1", "1/2", "2", "0", "-1"])
def test_a_number_of_the_guarantee_is_the_one_that_is_proved(case, outcome_of, factor):
    """Without the words of the statement it is refused; with them a larger level may be proved."""
    genuine = design_of(case).result
    for place in read_places(case):
        if place[0] == "guarantee" and at(genuine, place):
            forged, before = scaled(copy.deepcopy(genuine), place, factor), at(genuine, place)
            weaker = place[1] in case.optional and 0 < at(forged, place) < before
            near = place[-1] in SUPPLIES and factor in {"0.9", "1.1"}
            assert outcome_of(forged).exit_code or near or weaker, place
            if repr(before) in genuine["guarantee"]["statement"]:
                outcome = outcome_of(claiming_in_words(forged, before, at(forged, place)))
                assert outcome.exit_code or (place[-1] in LEVELS | BELIEVED and factor in {"1.1", "2"}), place


def storages(certificate, place=("certificate",)):
    """Places of the matrices of storage functions."""
    for name, value in certificate.items():
        if name in {"P", "P1", "P2"}:
            yield (*place, name)
        elif isinstance(value, dict):
            yield from storages(value, (*place, name))


@every_case
def test_a_forged_storage_function_proves_nothing(case, outcome_of):
    result = design_of(case).result
    for place in storages(result["certificate"]):
        for factor in ("-1", "0", "1/2", "2"):
            outcome = outcome_of(scaled(copy.deepcopy(result), place, factor))
            assert outcome.exit_code == 4, (place, factor)
            assert "NOT proved" in outcome.stdout
            assert "not proved" in outcome.stderr
        multipliers = (*place[:-1], "multipliers")
        for name, factor in product(at(result, multipliers), ("-1", "0")):
            assert outcome_of(scaled(copy.deepcopy(result), (*multipliers, name), factor)).exit_code == 4, place
        matrix = place
        while isinstance(at(result, (*matrix, 0, 0)), list):  # of the control values of a function of time
            matrix = (*matrix, 0)
        if len(at(result, matrix)) > 1:
            upper = (*matrix, 0, 1)
            assert outcome_of(scaled(copy.deepcopy(result), upper, 1 + Fraction(1, 10**15))).exit_code in {2, 4}, place


@every_case
@pytest.mark.parametrize("factor", ["-1", "0", "1000"])
def test_other_gains_are_not_proved(case, outcome_of, factor):
    design = design_of(case)
    for name, gain in design.gains.items():
        if gain.any():
            outcome = outcome_of(scaled(copy.deepcopy(design.result), ("observer", name), factor))
            given = {**case.observer, **case.observer.get("gains", {})}
            assert outcome.exit_code == (2 if name in given else 4), name


def leaves(value, place=()):
    """Places of the numbers in a part of a file."""
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            if key not in {"checks", "kind", "statement", "method"}:
                yield from leaves(item, (*place, key))
    elif not isinstance(value, bool):
        yield place


def read_places(case):
    """Places of the numbers that a proof reads."""
    design = design_of(case)
    parts = {"guarantee": at(design.result, ["guarantee"]).keys() - design.limits().keys()}
    parts |= {"observer": {*design.gains, *case.read}, "certificate": design.result["certificate"].keys()}
    listed = [(part, key) for part, keys in parts.items() for key in sorted(keys - {"checks", "kind", "statement"})]
    return [place for part in listed for place in leaves(at(design.result, part), part)]


BELIEVED = {"rate", "overshoot", "initial", "disturbance", "noise"}  # if not better than what is proved
SPARE = 1e-3  # relative, beyond the largest interval that was proved: its witness may prove a little more
FACTORS = (
    st.sampled_from([-1, 0, Fraction(1, 2), 2, 1000])
    | st.fractions(-2, 2)
    | st.integers(6, 12).map(lambda digits: 1 + Fraction((-1) ** digits, 10**digits))
)


@every_case
@examples(15)
@given(data=st.data())
def test_a_changed_number_proves_nothing_that_is_not_true(case, outcome_of, tmp_path, data):
    """Another witness, or gains, may do; then simulation finds the same bounds kept, with the same claim."""
    genuine = design_of(case).result
    place, factor = data.draw(st.sampled_from(read_places(case))), data.draw(FACTORS)
    before = at(genuine, place)
    forged = put(copy.deepcopy(genuine), place, float(factor)) if not before else None
    forged = forged or scaled(copy.deepcopy(genuine), place, factor)
    assume(at(forged, place) != before)
    outcome = outcome_of(forged)
    if outcome.exit_code:
        return
    if place[0] == "guarantee" and place[-1] not in SUPPLIES | BELIEVED:
        assert place[1] in case.optional
        assert at(forged, place) < before * (1 + SPARE)
    design = od.read(tmp_path / "forged.json")
    assert design.guarantee is not None
    run = design.simulate()
    assert run.summary["bounds"]
    assert all(bound["holds"] for bound in run.summary["bounds"])


# Files that are malformed

NO_NUMBERS = ("1/0", "0x10", "1e999", "nan", "-inf", "", "1.5/2", "1e", None, True, [], {}, [["0"]])


@every_case
def test_what_is_no_number_is_refused_by_the_name_of_its_key(case, outcome_of):
    places = {}
    for place in read_places(case):
        places.setdefault(tuple(key for key in place if isinstance(key, str)), []).append(place)
    some = [place for of_key in places.values() for place in of_key[:: len(of_key) // len(NO_NUMBERS) + 1]]
    for i, place in enumerate(some):
        outcome = outcome_of(put(copy.deepcopy(design_of(case).result), place, NO_NUMBERS[i % len(NO_NUMBERS)]))
        assert outcome.exit_code == 2, place
        assert ".".join(key for key in place[:2] if isinstance(key, str)) in outcome.stderr


@every_case
def test_what_is_missing_is_named(case, outcome_of):
    genuine = design_of(case).result
    named = {tuple(key for key in place if isinstance(key, str)) for place in read_places(case)}
    places = {place[:length] for place in named for length in range(1, len(place) + 1)}
    for place in sorted({*places, ("guarantee", "statement"), ("observer", "type"), ("status",), ("spec",)}):
        forged = copy.deepcopy(genuine)
        del at(forged, place[:-1])[place[-1]]
        outcome = outcome_of(forged)
        if place not in {("guarantee", key) for key in case.optional}:
            assert outcome.exit_code == 2, place
            named = place[-1] not in case.told
            assert (".".join(place) if named else "guarantee.statement") in outcome.stderr
            assert "missing" in outcome.stderr or not named


LEAVES = st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-2, 2) | st.sampled_from(["1/0", "1/2", "x", ""])
JSONS = st.recursive(LEAVES, lambda c: st.lists(c, max_size=3) | st.dictionaries(st.text(max_size=2), c, max_size=2))


@every_case
@examples(15)
@given(data=st.data())
def test_whatever_is_put_in_the_place_of_anything_is_answered(case, outcome_of, data):
    content = copy.deepcopy(design_of(case).result)
    value, place = content, []
    while isinstance(value, dict | list) and value and (not place or data.draw(st.booleans())):
        place.append(data.draw(st.sampled_from(list(value) if isinstance(value, dict) else range(len(value)))))
        value = value[place[-1]]
    outcome_of(put(content, place, data.draw(JSONS)))


@every_case
@pytest.mark.parametrize("type_", [*FAMILIES, "", None, 1])
def test_a_claim_of_one_family_is_none_of_another(case, outcome_of, type_):
    if type_ != case.observer["type"]:
        outcome = outcome_of(put(copy.deepcopy(design_of(case).result), ("observer", "type"), type_))
        assert outcome.exit_code == 2
        assert "observer.type" in outcome.stderr


# No solution


@every_case
def test_where_there_is_no_solution_the_file_says_why(case, tmp_path, outcome_of):
    design = od.solve(od.Spec(name="hopeless", **case.sections(**case.hopeless)))
    assert design.status == "infeasible"
    assert (design.gains, design.claim, design.guarantee) == ({}, None, None)
    assert design.diagnosis["condition"]
    assert design.diagnosis["reason"] in str(design)
    design.save(tmp_path / "gains.json")
    text = (tmp_path / "gains.json").read_text()
    assert broken_rules(read(text), ()) == []
    outcome = outcome_of(text)
    assert outcome.exit_code == (0 if "certificate" in design.diagnosis else 2)
    assert "certificate" in design.diagnosis or "no certificate" in outcome.stderr
    assert outcome_of(read(text) | {"status": "certified"}).exit_code == 2
    for certificate in ({}, [], 1, {"alpha": "1"}, {"alpha": "1", "multipliers": {}}):
        assert outcome_of(put(read(text), ("diagnosis", "certificate"), certificate)).exit_code == 2
    for use in (design.simulate, lambda: od.read(tmp_path / "gains.json")):
        with pytest.raises(od.UsageError, match="no gains"):
            use()


# Other units

T, BACK = np.array([[8, 0.5], [0, 0.01]]), np.array([[0.125, -6.25], [0, 100]])


def times(section, factor, *keys):
    """Multiply some keys of a section, where they stand."""
    section |= {key: factor * np.array(section[key]) for key in keys if key in section}


def in_states(sections, T=T, BACK=BACK):
    """T x in place of x."""
    system = sections["system"]
    system |= {"A": T @ system["A"] @ BACK, "B": T @ system["B"], "C": system["C"] @ BACK}
    for block in sections["nonlinearities"]:
        block |= {"Bf": T @ block["Bf"], "Cq": block["Cq"] @ BACK}
    sections["performance"] = {"H": sections["performance"]["H"] @ BACK}


def in_w(sections, factor=10):
    """Take w / 10 in place of w."""
    times(sections["system"], factor, "B", "D")
    for block in sections["nonlinearities"]:
        times(block, factor, "Dq")


def in_y(sections, factor):
    """Take factor y in place of y."""
    times(sections["system"], factor, "C", "D")


def in_z(sections, factor=10):
    """10 z in place of z."""
    times(sections["performance"], factor, "H")


def in_time(sections, factor=1e-3):
    """Milliseconds in place of seconds."""
    times(sections["system"], factor, "A", "B")
    for block in sections["nonlinearities"]:
        times(block, factor, "Bf")
    times(sections["observer"], factor, *RATES)
    times(sections["observer"], 1 / factor, *TIMES)


SINGLE = [pytest.param(*one, marks=pytest.mark.slow) for one in ((in_w, 10), (in_z, 10), (in_time, 1))]


@pytest.mark.parametrize(("change", "factor"), [(in_states, 1), *SINGLE])  # units of all are changed together below
@pytest.mark.parametrize("case", [case for case in CASES if case.values[0].scalable])
def test_other_units_change_the_limit_as_they_must(case, change, factor):
    sections = case.sections(observer={"bounds": None})
    change(sections)
    design, before = od.solve(od.Spec(**sections)), design_of(case).limit
    assert design.status == "certified"
    for name, shipped in (("gamma", design.result["guarantee"]["gamma"]), ("lipschitz", None)):
        if name in before:
            assert before[name] > 0
            assert design.limit[name] == pytest.approx((factor if name == "gamma" else 1) * before[name], rel=case.same)
            assert shipped is None or 1 <= shipped / design.limit[name] <= 1.051


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
@pytest.mark.parametrize("case", [case for case in CASES if case.values[0].scalable])
def test_units_do_not_decide(case, seed):
    """Powers of ten from 1e-9 to 1e9 in every state, y, w, z and 1 / time: same verdict, and gamma in its unit."""
    powers = 10.0 ** np.random.default_rng(seed).integers(-9, 10, 6)
    sections = case.sections(observer={"bounds": None})
    in_states(sections, np.diag(powers[:2]), np.diag(1 / powers[:2]))
    for change, power in zip((in_y, in_w, in_z, in_time), powers[2:], strict=True):
        change(sections, power)
    design, before = od.solve(od.Spec(**sections)), design_of(case).limit
    assert design.status == "certified"
    for name, factor in (("gamma", powers[3] * powers[4]), ("lipschitz", 1)):
        assert name not in before or design.limit[name] == pytest.approx(factor * before[name], rel=case.same)
    if "gamma" in before:
        assert 1 <= design.result["guarantee"]["gamma"] / design.limit["gamma"] <= 1.051


# Runs


@every_case
def test_a_run_keeps_every_bound(case):
    design, sampled = design_of(case), FAMILIES[case.observer["type"]].sampled
    for seed, x0 in enumerate(([0, 0], [1, -0.5], [-20, 3])):
        trial = {"x0": x0, "seed": seed} | ({"sampling": "random"} if sampled else {})
        summary = design.simulate(**trial).summary
        assert summary["bounds"]
        assert all(bound["holds"] for bound in summary["bounds"]), summary["bounds"]


@every_case
def test_a_design_that_was_read_runs_as_the_one_that_was_written(case, tmp_path):
    design = design_of(case)
    design.save(tmp_path / "gains.json")
    assert od.read(tmp_path / "gains.json").simulate().summary == design.simulate().summary


@every_case
def test_one_of_many_runs_is_the_run_of_its_seed(case):
    design = design_of(case)
    drawn = {"x0_width": [0.1, 0.2], "seed": 4}
    found = design.montecarlo(3, **drawn)
    assert [one.seed for one in found.members] == [4, 5, 6]
    name, errors = list(found.report["errors"].items())[-1]
    run = design.simulate(**{**drawn, "seed": errors["seed"]})
    assert run.summary["settling"][name]["peak"] == errors["peak"]
    assert all(bound["holds"] and bound["proved"] and bound["checked"] <= 3 for bound in found.report["bounds"])


@every_case
def test_what_is_not_proved_bounds_no_run(case, tmp_path):
    forged = copy.deepcopy(design_of(case).result)
    for place in storages(forged["certificate"]):
        scaled(forged, place, -1)
    (tmp_path / "forged.json").write_text(json.dumps(forged))
    design = od.read(tmp_path / "forged.json")
    assert (design.status, design.guarantee) == ("uncertified", None)
    assert design.simulate().summary["bounds"] == []


@pytest.mark.parametrize("case", [case for case in CASES if case.values[0].uncovered])
def test_what_is_proved_of_another_plant_bounds_no_run(case):
    design = od.solve(od.Spec(**case.sections(**case.uncovered)))
    assert (design.status, design.guarantee) == ("certified", None)
    assert design.verify().holds
    assert design.simulate().summary["bounds"] == []
