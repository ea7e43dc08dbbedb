"""Files are written whole or not at all; what is written is read back the same."""

import csv as reader
import hashlib
import io
import json
import os
import stat
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.commands import files
from support.lipschitz import written

from obsdesign.disk import write_whole
from obsdesign.errors import UsageError
from obsdesign.families.outcome import Outcome, Search, Verdict
from obsdesign.files import csv, digest, to_json
from obsdesign.reading import loads

ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


@pytest.fixture
def folder(tmp_path):
    """A folder that holds one old file."""
    (tmp_path / "gains.json").write_bytes(b"old")
    return tmp_path


def test_a_file_is_written_and_replaced_and_nothing_else_is_left(folder):
    write_whole(folder / "gains.json", b"new")
    write_whole(str(folder / "other.json"), b"")
    assert (folder / "gains.json").read_bytes() == b"new"
    assert (folder / "other.json").read_bytes() == b""
    assert files(folder) == ["gains.json", "other.json"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError, OSError(28, "No space left on device")])
@pytest.mark.parametrize("step", ["chmod", "replace"])
def test_a_write_that_fails_leaves_the_old_file_and_no_other(folder, monkeypatch, error, step):
    def failing(*_args, **_options):
        raise error

    monkeypatch.setattr(os, step, failing)
    with pytest.raises(UsageError if isinstance(error, OSError) else error) as caught:
        write_whole(folder / "gains.json", b"new")
    assert (folder / "gains.json").read_bytes() == b"old"
    assert files(folder) == ["gains.json"]
    if isinstance(error, OSError):
        assert str(caught.value) == f"{folder / 'gains.json'}: cannot be written: No space left on device [OBS902]"


def test_a_reader_never_sees_a_part_of_a_file(folder, monkeypatch):
    seen = []
    replace = os.replace

    def watched(source, target):
        seen.append(((folder / "gains.json").read_bytes(), Path(source).read_bytes(), Path(source).parent))
        replace(source, target)

    monkeypatch.setattr(os, "replace", watched)
    write_whole(folder / "gains.json", b"new" * 100_000)
    assert seen == [(b"old", b"new" * 100_000, folder)]


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_a_new_file_has_the_permissions_that_the_user_allows(tmp_path, mask, mode):
    before = os.umask(mask)
    try:
        write_whole(tmp_path / "gains.json", b"new")
        assert os.umask(mask) == mask
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "gains.json").stat().st_mode) == mode


def test_a_missing_folder_is_named(tmp_path):
    target = tmp_path / "absent" / "gains.json"
    with pytest.raises(UsageError) as caught:
        write_whole(target, b"new")
    assert str(caught.value) == f"{target}: cannot be written: No such file or directory [OBS902]"
    assert not target.parent.exists()


@pytest.mark.parametrize("name", ["", "taken", "gains.json/x", "n" * 300])
def test_a_target_that_can_be_no_file_is_refused_and_leaves_nothing(folder, name):
    (folder / "taken").mkdir()
    with pytest.raises(UsageError, match="cannot be written"):
        write_whole(f"{folder}/{name}", b"new")
    assert files(folder) == ["gains.json", "taken"]
    assert (folder / "gains.json").read_bytes() == b"old"


@pytest.mark.skipif(ROOT, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_is_named(tmp_path):
    tmp_path.chmod(0o555)
    with pytest.raises(UsageError, match="Permission denied"):
        write_whole(tmp_path / "gains.json", b"new")


def test_a_link_is_written_through_or_replaced_but_never_broken(tmp_path):
    (tmp_path / "real.json").write_bytes(b"old")
    (tmp_path / "link.json").symlink_to("real.json")
    write_whole(tmp_path / "link.json", b"new")
    assert (tmp_path / "link.json").read_bytes() == b"new"


# JSON

SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
VALUES = st.recursive(SCALARS, lambda c: st.lists(c, max_size=4) | st.dictionaries(st.text(), c, max_size=4))


@given(VALUES)
def test_json_is_read_back_as_it_was(value):
    assert json.loads(to_json(value)) == value
    assert to_json(value).endswith("\n")


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_double_keeps_every_digit(x):
    (back,) = json.loads(to_json([x]))
    assert back == x
    assert np.signbit(back) == np.signbit(x)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("wrap", [lambda x: x, lambda x: [[x]], lambda x: {"a": [{"b": x}]}])
def test_what_is_no_number_is_never_written(value, wrap):
    with pytest.raises(ValueError, match="JSON compliant"):
        to_json(wrap(value))


def test_a_matrix_has_one_line_a_row_and_text_stays_readable():
    text = to_json({"a": 1, "m": [[1, 2], [3, 4]], "e": [], "o": {}, "s": "‖z‖ ≤ γ"})
    assert text.splitlines() == [
        "{",
        '  "a": 1,',
        '  "m": [',
        "    [1, 2],",
        "    [3, 4]",
        "  ],",
        '  "e": [],',
        '  "o": {},',
        '  "s": "‖z‖ ≤ γ"',
        "}",
    ]


def test_a_digest_is_the_one_that_every_tool_computes(bearing):
    text = bearing.read_text()
    assert digest(text) == hashlib.sha256(bearing.read_bytes()).hexdigest()
    assert digest(text + " ") != digest(text)


# CSV


def test_a_table_is_read_back_to_twelve_digits():
    rows = np.array([[0.0, np.pi, -1e-300], [1 / 3, 1e20, 123456789012.5]])
    text = csv(["t", "x1", "hat_x1"], rows).decode()
    header, *lines = reader.reader(io.StringIO(text))
    assert header == ["t", "x1", "hat_x1"]
    np.testing.assert_allclose(np.array(lines, dtype=float), rows, rtol=1e-11)
    assert text.endswith("\n")
    assert "\r" not in text


# Observers of Lipschitz systems

INFINITE = {"lipschitz": float("inf"), "attained": False}
UNBOUNDED = {"unbounded": True, "attained": False}


def front(searched):
    """A spec that asks for a front."""
    return loads(
        "obsdesign: 1\nsystem: {A: [[0, 1], [-1, -1]], B: [1, 1], C: [1, 0]}\n"
        "nonlinearities: [{type: {lipschitz: 0.4}}]\n"
        f"observer: {{type: lipschitz, objective: pareto, {searched}}}\n",
        "front.yaml",
    )


@pytest.mark.parametrize(
    ("searched", "parameters"),
    [
        ("weight: {min: 0.1, max: 1}", {"parameter": "weight"}),
        ("weight: 0.5, decay: {min: 0.1, max: 1}", {"parameter": "decay"}),
        (
            "weight: {min: 0.1, max: 1}, decay: {min: 0.1, max: 1}",
            {"parameter": "weight", "parameters": ["weight", "decay"]},
        ),
    ],
)
def test_a_search_names_what_was_searched(searched, parameters):
    points = ({"weight": 0.5, "decay": 0.2, "lipschitz": 0.6, "gamma": 1.0, "status": "optimal", "attained": True},)
    search = Search(parameters["parameter"], points, tuple(parameters.get("parameters", ())))
    made = written(front(searched), Outcome(Verdict.INFEASIBLE, search=search))
    assert made["search"] == {**parameters, "points": list(points)}


def test_what_is_infinite_is_written_as_unbounded():
    made = written(
        front("weight: {min: 0.1, max: 1}"),
        Outcome(
            Verdict.UNCERTIFIED,
            gains={"L": np.array([[1.0], [2.0]])},
            limit=INFINITE,
            limit_bounded={"lipschitz": 3.0},
            search=Search("weight", ({"weight": 1.0, "decay": 0.1, "gamma": float("inf"), "status": "optimal"},)),
        ),
    )
    assert made["guarantee"] == {
        "limit": UNBOUNDED,
        "limit_bounded": {"lipschitz": 3.0},
    }
    assert made["search"]["points"] == [{"weight": 1.0, "decay": 0.1, "status": "optimal", **UNBOUNDED}]


def test_the_figures_of_a_gain_are_those_of_the_error_dynamics_with_the_sign_of_the_paper():
    outcome = Outcome(Verdict.UNCERTIFIED, gains={"L": np.array([[1.0], [0.0]])})
    made = written(front("weight: 0.5"), outcome)["observer"]
    assert made["L"] == [[1.0], [0.0]]
    np.testing.assert_allclose(made["poles"], [[-1, -1], [-1, 1]])
