"""Reports: one page in one file, what it says is what is proved anew, and no name in it does harm."""

import base64
import hashlib
import json
import re
from itertools import chain, pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.commands import run
from support.page import contrast, palettes, read

import obsdesign as od
from obsdesign.batches.find import Task
from obsdesign.batches.perform import perform
from obsdesign.batches.record import Options, entry_of, kept
from obsdesign.batches.summary import Tally, write
from obsdesign.errors import Problem
from obsdesign.expressions import parse
from obsdesign.reports import mathml
from obsdesign.reports.chart import Axis, Chart, Curve, of_errors, over_time, thinned
from obsdesign.reports.papers import PAPERS, paper_of
from obsdesign.reports.problem import DesignProblem
from obsdesign.reports.trajectories import Signals, charts

ROOT = Path(__file__).parent.parent
STYLE = (ROOT / "obsdesign" / "reports" / "templates" / "page.css").read_text()
HEADINGS = ("h1", "h2", "h3")

SMALL = """\
obsdesign: 1
name: Small
system: {states: [angle, rate], units: {angle: rad}, A: [[0, 1], [-4, -1]], B: [[0], [1]], C: [[1, 0]], D: 0.1}
nonlinearities: [{f: sin(q), type: sin, Bf: [0, -1], Cq: [1, 0]}]
performance: [rate]
observer: {type: l2, alpha: 0.2, bounds: {L1: 50}}
simulation: {horizon: 4, x0: [1, 0], w: [sin(t)], points: 400}
expect: {status: certified, guarantee.alpha: {verified: 0.2, printed: 0.5, note: half of it}}
"""
KKL = """\
obsdesign: 1
name: Drag
system:
  states: [x1, x2]
  dynamics: {x1: x2, x2: -x2 - x1**3/2}
  outputs: {y1: x1}
  domain: {x1: [-2, 2]}
observer:
  type: kkl
  coordinates: [{name: xi1, phi: x2 - x1, lambda: -2, B: -2*y1 - y1**3/2}]
  left_inverse: {x2: xi1 + y1}
simulation: {horizon: 2, x0: [1, 0]}
"""
HIDDEN = """\
obsdesign: 1
name: Hidden
system: {A: [[1, 0], [0, -1]], B: [[1], [1]], C: [[0, 1]]}
observer: {type: l2, alpha: 0.1}
"""


def solved(folder, text, name="small"):
    """Result file of a spec."""
    spec, gains = folder / f"{name}.yaml", folder / f"{name}.gains.json"
    spec.write_text(text)
    assert run("solve", spec, "-o", gains, "-q").exit_code in {0, 3}
    return gains


def changed(**sections):
    """Text of the small spec with other sections, or without those that are None."""
    spec = {**yaml.safe_load(SMALL), **sections}
    return yaml.safe_dump({key: value for key, value in spec.items() if value is not None})


def reported(source, folder, code=0):
    """Page of a source, as a text, and what the command said."""
    outcome = run("report", source, "-o", folder / "report.html")
    assert outcome.exit_code == code, (outcome.output, outcome.stderr, outcome.exception)
    return (folder / "report.html").read_text(), outcome


def summarised(folder, *entries):
    """Write the summary of a batch with these entries."""
    head = {"tool": {}, "options": {}, "list_sha256": "", "time_s": 1.0}
    write(folder, Tally(), head, entries, 0)


def texts(root, *tags):
    """Texts of elements, with their white space as a reader sees it."""
    return [" ".join(e.text.split()) for e in root.all(*tags)]


def altered(path, **changes):
    """The file with some of its parts replaced."""
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, **changes}))
    return path


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Result of a small spec."""
    return solved(tmp_path_factory.mktemp("small"), SMALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of several specs, with the run of one of them, as a batch leaves them."""
    made = tmp_path_factory.mktemp("results")
    gains = solved(made, SMALL)
    assert run("simulate", gains, "-o", made / "small.run.csv", "--plot", made / "small.run.png", "-q").exit_code == 0
    solved(made, KKL, "drag")
    solved(made, HIDDEN, "hidden")
    search = {"type": "l2", "alpha": {"min": 0.1, "max": 0.8, "points": 3}, "objective": "pareto", "bounds": {"L1": 50}}
    solved(made, changed(name="Front", observer=search, expect=None, simulation=None), "front")
    late = entry_of(Task("late.yaml"), "timeout", 4, Problem("after 600 s", "late.yaml", id="OBS905"))
    summarised(made, late, entry_of(Task("small.yaml"), "certified", 0, files={"gains": "small.gains.json"}))
    return made


@pytest.fixture(scope="module")
def pages(small, folder, tmp_path_factory):
    """Page of one result, and page of a folder."""
    made = tmp_path_factory.mktemp("pages")
    return [reported(source, made)[0] for source in (small, folder)]


def test_a_page_says_what_is_proved_and_proves_it_anew(small, pages):
    root, content = read(pages[0]), json.loads(small.read_text())
    text = " ".join(root.text.split())
    assert "Proved anew while this page was made" in text
    for said in (content["guarantee"]["statement"].partition("; for ")[0], content["spec"]["sha256"]):
        assert said in text
    checks = [check["name"] for check in content["certificate"]["checks"]]
    assert [name for name in texts(root, "th") if name in checks] == checks
    assert hashlib.sha256(small.read_bytes()).hexdigest() in text
    parts = set(texts(next(root.all("nav")), "a"))
    notes = {"Notes of the file, not proved"}
    assert parts == {"Guarantee", "Problem", "Gains", "Trajectories", "Proof", "Numbers", "Expected", "Origin"} | notes
    cells = texts(root, "td")
    assert "0.5" in cells  # printed in the source, beside what was found
    assert "half of it" in cells


def test_gains_can_be_copied_as_they_stand_in_the_file(small, pages):
    content = json.loads(small.read_text())
    buttons = {b.text: b.attributes.get("data-text") for b in read(pages[0]).all("button")}
    assert json.loads(buttons["Copy L1 for Python"]) == content["observer"]["L1"]
    rows = buttons["Copy L1 for MATLAB"].strip("[]").split(";")
    assert [[float(x) for x in row.split(",")] for row in rows] == content["observer"]["L1"]
    assert buttons["Copy the spec"] == content["spec"]["text"]


def test_what_is_not_proved_anew_is_not_said_to_be_proved(small, tmp_path):
    """A witness that proves nothing: the page says so, and so does the exit code."""
    content = json.loads(small.read_text())
    content["certificate"]["P"] = (-np.eye(2)).tolist()
    forged = tmp_path / "forged.gains.json"
    forged.write_text(json.dumps(content))
    page, outcome = reported(forged, tmp_path, 4)
    assert "the claim is not proved" in outcome.stderr
    assert "Proved anew" not in page
    assert "Not proved." in page
    assert "FAILS" in texts(read(page), "td")


def test_a_file_that_says_more_than_is_proved_has_no_page(small, tmp_path):
    content = json.loads(small.read_text())
    limit = {**content["guarantee"]["limit"], "gamma": 1e3}
    forged = altered(solved(tmp_path, SMALL), guarantee={**content["guarantee"], "limit": limit})
    outcome = run("report", forged, "-o", tmp_path / "report.html")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert "guarantee.limit.gamma" in outcome.stderr
    assert not (tmp_path / "report.html").exists()
    page, outcome = reported(tmp_path, tmp_path, 2)  # of a folder, the others are shown, and this one with its fault
    assert "guarantee.limit.gamma" in outcome.stderr
    assert any("guarantee.limit.gamma" in cell for cell in texts(read(page), "td"))


def test_gains_without_a_proof_have_no_guarantee(small, tmp_path):
    content = json.loads(small.read_text())
    plain = tmp_path / "plain.gains.json"
    plain.write_text(json.dumps({**content, "status": "uncertified"}))
    text = reported(plain, tmp_path)[0]
    assert "No guarantee." in text
    assert "Proved anew" not in text
    assert "gain γ" not in text


def test_a_verdict_without_a_solution_is_proved_or_says_that_it_is_not(folder, tmp_path):
    page = reported(folder / "hidden.gains.json", tmp_path)[0]
    proved = "certificate" in json.loads((folder / "hidden.gains.json").read_text())["diagnosis"]
    assert proved
    assert "Proved anew" in page
    content = json.loads((folder / "hidden.gains.json").read_text())
    content["diagnosis"].pop("certificate")
    bare = tmp_path / "bare.gains.json"
    bare.write_text(json.dumps(content))
    page = reported(bare, tmp_path)[0]
    assert "no proof of it" in page
    assert "Proved anew" not in page
    assert content["diagnosis"]["reason"] in read(page).text


def test_a_local_guarantee_and_an_assumption_are_said_prominently(tmp_path):
    block = {"type": {"lipschitz": 1}, "region": {"q": [-1, 1]}, "Bf": [0, -1], "Cq": [1, 0]}
    root = read(reported(solved(tmp_path, changed(nonlinearities=[block], simulation=None)), tmp_path)[0])
    provisos = [" ".join(e.text.split()) for e in root.all("p") if e.attributes.get("class") == "proviso"]
    assert any(said.startswith("Local. It holds only as long as") for said in provisos)
    assert any(said.startswith("Assumed, not proved.") for said in provisos)


def test_an_observer_in_equations_is_written_out(folder, tmp_path):
    root = read(reported(folder / "drag.gains.json", tmp_path)[0])
    assert "xi1'" in texts(root, "th")
    assert "Domain: x1 in [-2, 2]." in texts(root, "p")
    (button,) = (b for b in root.all("button") if b.text == "Copy the equations")
    assert "xi1' = " in button.attributes["data-text"]


def test_a_folder_lists_every_result_and_what_gave_none(pages):
    root = read(pages[1])
    (table,) = (e for e in root.all("table") if e.attributes.get("class") == "results")
    rows = {next(chain(row.all("a"), row.all("th"))).text: row for row in next(table.all("tbody")).all("tr")}
    assert "small.gains.json" in next(rows["Small"].all("th")).text
    assert rows.keys() == {"Small", "Drag", "Hidden", "Front", "late.yaml"}
    assert "no result: timeout" in rows["late.yaml"].text
    assert "after 600 s" in rows["late.yaml"].text
    heads = [cell.text for cell in next(table.all("thead")).all("th")]
    told = dict(zip(heads[1:], (cell.text for cell in rows["late.yaml"].all("td")), strict=True))
    assert (told["further, proved"], told["why it is not shown"][:19]) == ("", "summary.json says: ")
    assert all(len(list(row.all("td"))) == len(heads) - 1 for row in rows.values())
    links = {name: next(row.all("a")).attributes["href"] for name, row in rows.items() if name != "late.yaml"}
    sheets = {e.attributes["id"]: next(e.all("h1")).text for e in root.all("article")}
    assert {name: sheets[link[1:]] for name, link in links.items()} == {name: name for name in links}
    assert "not run anew" not in root.text  # of small.run.csv nobody knows what gains it is of


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """What a batch leaves of a small spec, with its run."""
    made = tmp_path_factory.mktemp("recorded")
    task, options = Task(str(made / "small.yaml"), text=SMALL), Options(simulate=True)
    assert kept(perform(task, options), task, options, made)["exit_code"] == 0
    return {path.name: path.read_bytes() for path in made.rglob("small.*.*")}


def test_the_run_of_a_batch_is_read_as_long_as_it_and_its_gains_are_those_recorded(recorded, tmp_path):
    def origin(**changed):
        for ending in ("gains.json", "run.csv", "record.json"):
            (tmp_path / f"small.{ending}").write_bytes(recorded[f"small.{ending}"])
        for name, content in changed.items():
            (tmp_path / f"small.{name.replace('_', '.')}").write_bytes(content)
        root = read(reported(tmp_path, tmp_path)[0])
        return next(e.text for e in root.all("span") if "run" in e.text and e.attributes.get("class") == "mark")

    assert origin() == "read from small.run.csv, not run anew"
    anew = "run while this page was made"
    assert origin(gains_json=recorded["small.gains.json"] + b"\n") == anew
    assert origin(run_csv=recorded["small.run.csv"] + b"\n") == anew
    assert origin(record_json=b"{}") == anew


def test_a_run_that_is_none_of_this_plant_is_not_shown_though_a_record_has_its_hash(recorded, tmp_path):
    for text, said in (
        ("t,x1,hat_x1\n0,1,2\n1,1,2\n", "has no column angle"),
        ("t,angle,rate,hat_angle,hat_rate\n", "holds no samples"),
        ("t,angle,rate,hat_angle,hat_rate\n1,2,3,4,=1+1\n", "is no table of numbers"),
        ("", "is no table of numbers"),
        (f"t,angle,rate,hat_angle,hat_rate\n{'x' * 200_000}\n", "is no table of numbers"),
        ("t,angle,rate,hat_angle,hat_rate\n0,1,1,1,1\n1,-1.7e308,1.7e308,1,1\n", "some that are not finite"),
    ):
        (tmp_path / "small.gains.json").write_bytes(recorded["small.gains.json"])
        (tmp_path / "small.run.csv").write_text(text)
        record = json.loads(recorded["small.record.json"])
        record["hashes"]["csv"] = hashlib.sha256(text.encode()).hexdigest()
        (tmp_path / "small.record.json").write_text(json.dumps(record))
        assert said in reported(tmp_path, tmp_path)[0]


@pytest.mark.usefixtures("here", "at_once")
def test_what_an_earlier_batch_left_is_told_and_not_counted():
    for name in ("kept", "removed"):
        Path(f"{name}.yaml").write_text(
            f"obsdesign: 1\nname: {name}\nsystem: {{A: -1, B: 1, C: 1}}\n"
            "observer: {type: l2, alpha: 0.1, bounds: {L1: 5}}\n"
        )
    assert run("batch", ".", "-q", "--jobs", 1).exit_code == 0
    Path("removed.yaml").unlink()
    assert run("batch", ".", "-q", "--jobs", 1).exit_code == 0
    assert run("solve", "kept.yaml", "-o", "results/own.gains.json", "-q").exit_code == 0
    outcome = run("report", "results")
    assert outcome.stdout.startswith("2 certified, 1 left over\n")
    rows = [row.text for row in read(Path("report.html").read_text()).all("tr")]
    (left,) = (row for row in rows if "left over" in row)
    assert "results/removed/removed.gains.json" in left
    assert "no spec of the last batch" in left


@pytest.mark.parametrize("text", ["[" * 100_000, "5", '{"specs": 5}', '{"specs": [{"path": 5}]}'])
def test_a_summary_that_is_none_is_told(folder, tmp_path, text):
    (tmp_path / "small.gains.json").write_bytes((folder / "small.gains.json").read_bytes())
    (tmp_path / "summary.json").write_text(text)
    page, outcome = reported(tmp_path, tmp_path, 2)
    assert "no result" not in page
    assert outcome.stdout.startswith("1 certified, 1 invalid\n")
    assert outcome.stderr.startswith(f"{tmp_path / 'summary.json'}: ")


def test_a_search_has_its_points_as_a_chart_and_as_a_table(folder, tmp_path):
    page = reported(folder / "front.gains.json", tmp_path)[0]
    points = json.loads((folder / "front.gains.json").read_text())["search"]["points"]
    (table,) = (e for e in read(page).all("table") if "Points of the search" in e.text)
    assert len(list(next(table.all("tbody")).all("tr"))) == len(points)
    assert any("over alpha" in said for said in texts(read(page), "figcaption"))


def test_a_surface_is_a_map_with_the_value_of_every_cell(tmp_path):
    spec = yaml.safe_load((ROOT / "specs" / "abbaszadeh2010-polynomial-surface.yaml").read_text())
    spec["observer"] |= {"weight": {"min": 0.1, "max": 0.6, "points": 3}, "decay": {"min": 0, "max": 0.1, "points": 2}}
    root = read(reported(solved(tmp_path, yaml.safe_dump(spec)), tmp_path)[0])
    cells = [e.text for e in root.all("title") if ": weight " in e.text]
    assert len(cells) == 12
    assert len(set(cells)) == 12


def test_curves_side_by_side_keep_their_names(tmp_path):
    spec = yaml.safe_load((ROOT / "specs" / "ferrante2019-oscillator-tradeoff.yaml").read_text())
    spec["observer"] |= {"T2": {"min": 0.05, "max": 0.2, "points": 2}, "relaxation": ["proposition-2", "proposition-4"]}
    spec["observer"] |= {"injection": "dynamic", "delta": {"min": 1, "max": 10, "points": 3}}
    spec["expect"] = {}
    root = read(reported(solved(tmp_path, yaml.safe_dump(spec)), tmp_path)[0])
    names = [e.text for e in root.all("span") if e.attributes.get("class") == "name"]
    assert {"dynamic, proposition-2: limit", "dynamic, proposition-4: limit"} <= set(names)


def test_a_page_needs_nothing_from_elsewhere_and_runs_nothing_but_its_own(pages):
    for page in pages:
        root = read(page)
        for element in root.all(*{e.tag for e in descendants(root)}):
            assert not {"style", "onclick", "onload", "onerror", "src", "srcset", "action"} & element.attributes.keys()
            href = element.attributes.get("href", "#")
            assert href.startswith("#")
        assert not re.search(r"url\(|@import", STYLE)
        (policy,) = (m.attributes["content"] for m in root.all("meta") if "http-equiv" in m.attributes)
        style, script = next(root.all("style")).text, next(s for s in root.all("script") if not s.attributes).text
        for name, text in (("style", style), ("script", script)):
            found = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
            assert f"{name}-src 'sha256-{found}'" in policy
        assert "default-src 'none'" in policy


def descendants(root):
    """Every element."""
    for child in root.children:
        yield child
        yield from descendants(child)


def test_a_page_can_be_used_without_seeing_it(pages):
    """Landmarks, a language, names of all that can be used, headings in order, headers of tables, links that lead."""
    for page in pages:
        root = read(page)
        assert next(root.all("html")).attributes["lang"] == "en"
        assert next(root.all("title")).text
        for landmark in ("header", "main", "footer", "nav"):
            assert any(root.all(landmark))
        ids = [e.attributes["id"] for e in descendants(root) if "id" in e.attributes]
        assert len(ids) == len(set(ids))
        for element in descendants(root):
            attributes = element.attributes
            for reference in (attributes.get("aria-labelledby"), attributes.get("href", "").removeprefix("#")):
                assert not reference or reference in ids
            if attributes.get("role") in {"img", "group", "search"} or element.tag == "nav":
                assert attributes.get("aria-label"), element
            if element.tag in {"button", "a"}:
                assert element.text.strip()
                assert element.tag == "a" or attributes["type"] == "button"
            if element.tag in {"input", "select"}:
                assert element.ancestors[-1].tag == "label"
            if element.tag == "table":
                assert any(caption.text.strip() for caption in element.all("caption"))
                assert all(th.attributes.get("scope") in {"row", "col"} for th in element.all("th"))
        for sheet in root.all("article"):
            levels = [HEADINGS.index(e.tag) for e in sheet.all(*HEADINGS)]
            assert levels[0] == 0
            assert all(later - before <= 1 for before, later in pairwise(levels))


@pytest.mark.parametrize("name", ["light", "dark", "print"])
def test_colors_can_be_told_apart(name):
    """Text has a contrast of 4.5 at least on what it stands on, curves and frames of 3 (WCAG 2, level AA)."""
    colors = palettes(STYLE)[name]
    for ground in ("paper", "panel"):
        for text in ("ink", "muted", "accent", "good", "warn", "bad"):
            assert contrast(colors[text], colors[ground]) >= 4.5, (text, ground)
        for curve in (*(f"c{k}" for k in range(1, 9)), "focus"):
            assert contrast(colors[curve], colors[ground]) >= 3, (curve, ground)
    for tone in ("good", "warn", "bad", "plain"):
        assert contrast(colors[tone], colors[f"{tone}-paper"]) >= 4.5, tone
    assert "outline" in re.search(r":focus-visible \{(.*?)\}", STYLE).group(1)


def test_the_contrast_of_colors_is_that_of_the_definition():
    assert contrast("#ffffff", "#000000") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


HOSTILE = (
    "</script><script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    '" onmouseover="alert(1)" x=\'',
    "{{ 7*7 }}{% raw %}",
    "]]><!--",
    "javascript:alert(1)",
    "&lt;b&gt;",
)


@pytest.mark.parametrize("text", HOSTILE)
def test_a_text_of_a_spec_is_data(text, tmp_path):
    spec = yaml.safe_load(SMALL)
    spec |= {"name": text, "source": text, "description": text, "reproduces": [text]}
    spec["system"]["units"] = {"angle": text, "rate": text}
    spec["expect"]["guarantee.alpha"]["note"] = text
    place = tmp_path / re.sub(r"[/\0]", "_", text)
    place.mkdir()
    gains = solved(place, yaml.safe_dump(spec), "hostile")
    for source in (gains, tmp_path):
        page, plain = reported(source, tmp_path)[0], read(reported(source, tmp_path)[0])
        scripts = [e for e in plain.all("script") if e.attributes.get("type") != "application/json"]
        assert len(scripts) == 1
        assert not list(plain.all("img", "b x", "iframe", "object"))
        assert not any(name.startswith("on") for e in descendants(plain) for name in e.attributes)
        assert text in texts(plain, "h1")
        assert "<script>alert" not in page
        for data in (e for e in plain.all("script") if e.attributes):
            json.loads(data.text)


def test_what_cannot_be_printed_is_replaced(tmp_path):
    turned = "a turned \u202eline\u202c\nbelow"
    gains = solved(tmp_path, changed(description=turned))
    summarised(tmp_path, entry_of(Task("\x1b[31mred\x07"), "crashed", 1, Problem("a\x9bb", id="OBS909")))
    for source in (gains, tmp_path):
        page = reported(source, tmp_path)[0]
        assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e]", page)
        assert "a turned \ufffdline\ufffd\nbelow" in page


def test_a_folder_without_results_and_a_file_that_is_none_are_refused(tmp_path):
    (tmp_path / ".hidden").mkdir()
    (tmp_path / ".hidden" / "a.gains.json").write_text("{}")
    for source, said in ((tmp_path, "holds no result"), (tmp_path / "none.json", "cannot be read")):
        outcome = run("report", source, "-o", tmp_path / "report.html")
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert said in outcome.stderr
    outcome = run("report", tmp_path, "-o", tmp_path / "no" / "report.html")
    assert outcome.exit_code == 2
    assert "there is no folder" in outcome.stderr


def test_the_answer_of_the_command_is_short_or_json(small, tmp_path):
    out = tmp_path / "r.html"
    assert run("report", small, "-o", out, "-q").stdout == ""
    told = json.loads(run("report", small, "-o", out, "--json").stdout)
    assert told == {"file": str(out), "counts": {"certified": 1}, "without": []}
    assert run("report", small, "-o", out).stdout == f"1 certified\nreport  {out}   replaced\n"


def test_python_makes_the_page_of_a_design(tmp_path):
    design = od.solve(od.load(SMALL))
    page = od.report(design, tmp_path / "r.html")
    assert page.html == (tmp_path / "r.html").read_text()
    assert page.entries[0].proof.holds
    assert (page.failure, page.without) == (None, [])


def test_a_run_that_cannot_be_made_is_explained(tmp_path):
    block = {"type": {"lipschitz": 1}, "Bf": [0, -1], "Cq": [1, 0]}
    assert "no run: " in read(reported(solved(tmp_path, changed(nonlinearities=[block])), tmp_path)[0]).text


def items_of_specs():
    """Citation and items of each shipped spec that makes something again."""
    for path in sorted((ROOT / "specs").rglob("*.yaml")):
        spec = yaml.safe_load(path.read_text())
        for item in spec.get("reproduces", ()):
            yield path.stem, spec["source"], item


def test_every_item_of_the_papers_is_made_again_by_a_shipped_spec():
    made = {}
    for stem, source, item in items_of_specs():
        paper = paper_of(source)
        assert paper, stem
        assert item in paper.items, (stem, item)
        made.setdefault((paper.name, item), []).append(stem)
    listed = {(paper.name, item) for paper in PAPERS for item, shows in paper.items.items() if shows != "drawing"}
    assert listed == made.keys()


def test_papers_are_listed_with_what_they_print_and_what_is_missing(tmp_path):
    spec = yaml.safe_load((ROOT / "specs" / "abbaszadeh2010-second-order.yaml").read_text())
    spec["reproduces"] = ["Example 1", "Fig. 99"]
    solved(tmp_path, yaml.safe_dump(spec))
    root = read(reported(tmp_path, tmp_path)[0])
    (table,) = (e for e in root.all("table") if e.attributes.get("class") == "papers")
    rows = {next(row.all("th")).text: " ".join(row.text.split()) for row in table.all("tr") if any(row.all("th"))}
    assert "1.1933" in rows["Example 1"]
    assert "1.20711" in rows["Example 1"]
    assert "no spec here" in rows["Fig. 3"]
    assert "not in the list" in rows["Fig. 99"]
    (missing,) = (e.text for e in root.all("p") if e.attributes.get("id") == "without")
    assert "Fig. 3" in missing
    assert "Example 1" not in missing


FORMULAS = {
    "-(a + b)/2": "−a+b2",
    "a - 2*b": "a−2b",
    "a - (b - c)": "a−(b−c)",
    "-x1**2": "−x12",
    "(a + b)**2": "(a+b)2",
    "abs(q)*q": "|q|q",
    "where(t <= 1, -1, sqrt(t))": "where(t≤1,−1,t)",
    "1.5e-9*theta": "1.5·10-9θ",
    "a/b/c": "abc",
    "pi": "π",
    "3**(1/2)": "30.5",
    "a*-1": "−a",
    "2*(-3*a)": "−6a",
    "-a*(b + c)": "−a(b+c)",
}


@pytest.mark.parametrize(("text", "seen"), FORMULAS.items())
def test_an_expression_is_set_as_it_is_written_by_hand(text, seen):
    made = mathml.expression(parse(text, ["a", "b", "c", "q", "t", "theta", "x1"]))
    found = "".join(ElementTree.fromstring(f"<math>{made}</math>".replace("&#x", "&#x")).itertext())
    assert re.sub("[\u2061\u2062]", "", found) == seen


@given(st.text(max_size=20))
def test_a_name_is_escaped_in_a_formula(name):
    if not re.search("[^\t\n\r\x20-\ud7ff\ue000-\ufffd]", name):
        ElementTree.fromstring(f"<math>{mathml.symbol(name)}</math>")


@pytest.mark.parametrize(
    "name", ["pendulum", "cuk-kkl-pebo", "nonlinear-disturbance", "valve-multiplier", "planar-arm"]
)
def test_the_problem_of_a_spec_is_well_formed(name):
    problem = DesignProblem.of(od.load(str(ROOT / "specs" / f"{name}.yaml")))
    formulas = [*problem.equations, *(m.formula for m in problem.matrices), *(b.formula for b in problem.blocks)]
    for formula in filter(None, formulas):
        ElementTree.fromstring(formula)
    assert problem.signals


def test_a_large_matrix_is_folded_and_a_huge_one_is_left_to_the_spec():
    def sizes(n):
        spec = od.Spec(
            system={"A": -np.eye(n), "B": np.eye(n)[:, :1], "C": np.eye(n)[:1]}, observer={"type": "l2", "alpha": 0.1}
        )
        (A,) = (m for m in DesignProblem.of(spec).matrices if m.size == f"{n} × {n}" and "<mi>A</mi>" in m.symbol)
        return A.folded, A.formula is None

    assert [sizes(n) for n in (3, 13, 61)] == [(False, False), (True, False), (True, True)]


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_ticks_are_round_and_within_the_axis(low, width):
    axis = Axis("x", low, low + width)
    values = [value for value, _ in axis.ticks]
    assert 2 <= len(values) <= 12 or low + width == low
    assert all(low - 1e-6 * width <= value <= low + width * (1 + 1e-6) for value in values)


def test_ticks_of_a_logarithmic_axis_are_powers_of_ten():
    assert Axis("x", 1e-9, 2e3, log=True).ticks[0][1] == "10⁻⁹"
    assert [text for _, text in Axis("x", 0.05, 20, log=True).ticks] == ["0.1", "1", "10"]
    assert [text for _, text in Axis("x", 2, 8, log=True).ticks]
    assert Axis.over("x", np.array([np.nan])).ticks


def test_a_curve_of_many_samples_keeps_its_extremes():
    t = np.linspace(0, 1, 5000)
    y = np.sin(9 * t)
    y[1234] = 40
    which = thinned(t, y)
    assert len(which) < 400
    assert y[which].max() == 40
    assert (which[0], which[-1]) == (0, 4999)


def test_a_path_has_a_gap_where_there_is_no_value_and_stays_in_its_box():
    x, y = np.arange(5.0), np.array([0, 1, np.nan, 1, 2])
    chart = Chart("", x, (Curve("y", y),), Axis("x", 0, 4), Axis("y", 0, 2))
    assert chart.path(chart.curves[0]).count("M") == 2
    assert chart.marks(chart.curves[0])[0] == ("0.0", f"{chart.box[3]:.1f}")
    assert chart.data["curves"] == [[0, 1, None, 1, 2]]


def test_a_transient_that_leaves_the_truth_by_far_is_cut_and_told():
    t = np.linspace(0, 1, 100)
    chart = over_time("x", "x", t, [Curve("x", np.sin(t)), Curve("hat", np.sin(t) + 1e3 * np.exp(-90 * t))])
    assert chart.along.high < 3
    assert "cut: reaches 1e+03" in chart.note
    assert over_time("x", "x", t, [Curve("x", np.sin(t))]).note == ""


def test_what_is_late_is_not_cut():
    """An estimate that goes on to swing by more than the truth, after a high peak, is seen to do so."""
    t = np.linspace(0, 60, 2000)
    hat = 0.02 + 0.1 * np.sin(3 * t) + 5 * np.exp(-3 * t)
    chart = over_time("slope", "slope", t, [Curve("slope", 0.02 - 0.02 * np.exp(-t)), Curve("hat", hat)])
    assert -0.1 < chart.along.low < -0.08
    assert 0.12 < chart.along.high < 0.14
    assert chart.note == "cut: reaches 5.02"


@pytest.mark.parametrize(("w", "u", "shown"), [("0", "sin(t)", ["force"]), ("1", "0", ["push"]), ("0", "0", [])])
def test_every_input_has_a_chart_unless_it_is_always_zero(w, u, shown):
    text = f"""obsdesign: 1
name: inputs
system:
  states: [x]
  inputs: [force]
  disturbances: [push]
  dynamics: {{x: -x + force + push}}
  outputs: {{y: x}}
  units: {{force: N, push: N}}
observer: {{type: l2, alpha: 0.3, bounds: {{L1: 20}}}}
simulation: {{horizon: 1, x0: [1], xhat0: [1], w: ["{w}"], u: "{u}"}}
"""
    spec = od.load(text)
    made = list(charts(Signals.of(od.solve(spec).simulate()), spec))
    inputs = [chart for chart in made if chart.title.endswith("input")]
    assert [chart.title.split(",")[0] for chart in inputs] == shown
    assert [chart.along.label for chart in inputs] == [f"{name} [N]" for name in shown]
    (errors,) = [chart for chart in made if chart.title == "Absolute errors"]
    assert errors.curves[0].name == ("error of x" if w == "1" else "error of x: none")


def test_errors_over_decades_have_a_logarithmic_axis_and_others_a_linear_one():
    t = np.linspace(0, 10, 300)
    assert of_errors("e", "e", t, [Curve("e", np.exp(-t))]).along.log
    assert not of_errors("e", "e", t, [Curve("e", np.cos(t))]).along.log
    assert not of_errors("e", "e", t, [Curve("e", 0 * t)]).along.log


def test_a_number_is_written_in_full_where_it_is_short():
    assert "…" in mathml.number(fmpq(1, 3) + fmpq(1, 10**12))
    assert "mfrac" in mathml.number(fmpq(1, 3))
    assert "0.25" in mathml.number(fmpq(1, 4))
