"""What commands say to somebody who is new to them."""

import html
import json
from pathlib import Path

import pytest
from support.commands import run

pytestmark = pytest.mark.usefixtures("here")

SPEC = "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], C: [1, 0]}\nobserver: {type: l2, alpha: 0.3, bounds: {L1: 9}}\n"


@pytest.fixture
def batch():
    """A sweep over a spec, and what it prints."""
    Path("specs").mkdir()
    Path("specs/spec.yaml").write_text(SPEC)
    return run("batch", "specs", "--set", "observer.alpha=0.2,0.1,0.03,1e-3", "--jobs", "1", "--exclude", "old*")


def test_a_sweep_is_in_the_order_of_its_numbers_and_aligned(batch):
    assert batch.exit_code == 0, batch.output
    lines = batch.stdout.splitlines()[:-1]
    assert [line.split("alpha=")[1].split()[0] for line in lines] == ["1e-3", "0.03", "0.1", "0.2"]
    assert len({line.index(" s  ") for line in lines}) == 1
    kept = json.loads(Path("results/summary.json").read_text())["specs"]
    assert [one["set"][0] for one in kept] == [f"observer.alpha={value}" for value in ("1e-3", "0.03", "0.1", "0.2")]


def test_a_pattern_that_leaves_nothing_out_is_told(batch):
    said = "--exclude old*: leaves nothing out; no spec below the paths matches"
    assert said in batch.stderr.splitlines()
    again = run("batch", "specs", "--exclude", "spec.*", "--exclude", "specs/")
    assert (again.exit_code, "leaves nothing out" in again.stderr) == (2, False)


@pytest.mark.parametrize("command", [("diff", "results/summary.json"), ("report",), ("verify",), ("simulate",)])
def test_the_summary_of_a_batch_is_no_result_and_says_which_file_to_give(batch, command):
    assert batch.exit_code == 0
    outcome = run(*command, "results/summary.json")
    assert outcome.exit_code == 2
    said = "is the summary of a batch; give a gains file of it (specs[..].files.gains), or `report` its folder [OBS701]"
    assert said in outcome.stderr


def test_an_id_that_there_is_not_names_those_of_its_kind():
    assert "there is no page of it; allowed: OBS901 to OBS9" in run("explain", "obs999").stderr
    assert "there is no page of it; allowed: ids that begin with OBS1.., OBS2.., " in run("explain", "OBS099").stderr


def test_a_form_that_there_is_not_is_told_plainly():
    outcome = run("batch", ".", "--format", "bogus")
    assert outcome.exit_code == 2
    assert "'bogus' is not one of 'junit', 'github', 'sarif', 'json'" in outcome.stderr
    assert "Value error" not in outcome.stderr


def test_a_spec_of_which_only_a_comment_changed_is_told_apart_from_another_one():
    Path("spec.yaml").write_text(SPEC)
    assert run("solve", "spec.yaml", "-q").exit_code == 0
    Path("spec.yaml").write_text(SPEC.replace("obsdesign: 1", "obsdesign: 1  # the first format"))
    outcome = run("verify", "--specs", "spec.gains.json")
    assert outcome.exit_code == 2
    assert (
        "belong to another spec than spec.yaml, of which only comments or layout differ; solve it again"
        in outcome.stderr
    )
    Path("spec.yaml").write_text(SPEC.replace("0.3", "0.4"))
    outcome = run("verify", "--specs", "spec.gains.json")
    assert "these gains belong to another spec than spec.yaml; solve it again" in outcome.stderr


def test_a_proved_number_has_the_same_digits_in_the_table_and_in_the_report():
    Path("spec.yaml").write_text(SPEC.replace("C: [1, 0]", "B: [0, 1], C: [1, 0]"))
    table = run("solve", "spec.yaml").stdout
    gamma = next(line.split()[1] for line in table.splitlines() if line.startswith("gamma"))
    assert len(gamma.replace(".", "").lstrip("0")) == 6
    assert run("report", "spec.gains.json").exit_code == 0
    assert f"<dt>gain γ</dt><dd>{gamma}</dd>" in Path("report.html").read_text()


def test_a_page_says_in_its_own_words_what_is_proved_where_there_is_no_solution():
    Path("spec.yaml").write_text("obsdesign: 1\nsystem: {A: 0.2, B: 1, C: 0}\nobserver: {type: l2, alpha: 0.3}\n")
    assert run("solve", "spec.yaml", "-q").exit_code == 3
    claim = run("verify", "spec.gains.json").stdout.splitlines()[-1].partition("proved: ")[2]
    assert claim
    content = json.loads(Path("spec.gains.json").read_text())
    forged = "it is proved exactly that no observer of any kind exists"
    content["diagnosis"] |= {"reason": forged, "condition": forged, "suggestion": forged}
    Path("spec.gains.json").write_text(json.dumps(content))
    assert run("report", "spec.gains.json").exit_code == 0
    page = html.unescape(Path("report.html").read_text())
    assert f"what is proved is no more than the verdict above: {claim}." in page
    verdict, _, diagnosis = page.partition('Diagnosis <span class="mark">numerical, not proved</span>')
    assert (forged in verdict, diagnosis.count(forged)) == (False, 3)
