"""What clicks write into a job: comments stay, each change can be undone, nothing of others is overwritten."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from damageest_app import edits
from damageest_app.jobfile import ConflictError, JobFile
from hypothesis import given
from hypothesis import strategies as st

from damageest.errors import JobError
from damageest.job import load
from damageest.registry import Registry

TEXT = """\
# a job with words
version: 1
units: mm   # of all lengths
part: box.stl
scan: scan.ply
align: register   # any start pose
"""


def allow(_: Path) -> None:
    return None


@pytest.fixture
def job(tmp_path: Path) -> JobFile:
    (tmp_path / "job.yaml").write_text(TEXT)
    return JobFile(tmp_path / "job.yaml")


def test_comments_stay_and_each_change_is_undone(job: JobFile) -> None:
    assert job.edit(lambda tree: edits.set_field(tree, "tolerance", 0.25), allow)
    assert job.edit(lambda tree: edits.toggle_datum(tree, 3), allow)
    assert "# a job with words" in job.path.read_text()
    assert "# of all lengths" in job.path.read_text()
    assert job.values["tolerance"] == 0.25
    assert job.values["align"] == {"use": "register", "datum": [3]}
    assert job.undo()
    assert job.undo()
    assert not job.undo()
    assert job.path.read_text() == TEXT
    assert job.redo()
    assert job.values["tolerance"] == 0.25


def test_a_file_that_another_program_changed_is_left_as_it_is(job: JobFile) -> None:
    other = TEXT + "name: other\n"
    job.path.write_text(other)
    with pytest.raises(ConflictError, match="changed by another program"):
        job.edit(lambda tree: edits.set_field(tree, "tolerance", 0.25), allow)
    assert job.path.read_text() == other
    job.reload()
    assert job.edit(lambda tree: edits.set_field(tree, "tolerance", 0.25), allow)
    assert job.values["name"] == "other"


def test_a_change_that_is_not_valid_leaves_the_file(job: JobFile, registry: Registry) -> None:
    with pytest.raises(JobError):
        job.edit(lambda tree: edits.set_field(tree, "tolerance", -1.0), lambda path: load(path, registry))
    assert job.path.read_text() == TEXT
    assert [path.name for path in job.path.parent.iterdir()] == ["job.yaml"]


def test_choices_about_sites_are_lines_of_the_job() -> None:
    tree: dict[str, Any] = {}
    edits.choose_site(tree, 2, "accept", is_doubtful=True)
    edits.choose_site(tree, 3, "drop", is_doubtful=False)
    assert edits.plain(tree) == {"accept": [2], "sites": {"drop": [3]}}
    edits.choose_site(tree, 2, "drop", is_doubtful=True)
    assert edits.plain(tree) == {"sites": {"drop": [2, 3]}}
    edits.choose_site(tree, 2, "", is_doubtful=True)
    edits.choose_site(tree, 3, "", is_doubtful=False)
    assert tree == {}
    edits.merge_sites(tree, [1, 2])
    edits.merge_sites(tree, [2, 5])
    assert edits.plain(tree) == {"sites": {"merge": [[1, 2, 5]]}}


def test_stock_of_a_face_is_replaced_and_kept_out() -> None:
    tree: dict[str, Any] = {}
    edits.set_stock(tree, 0.4)
    edits.set_face_stock(tree, 7, 1.0)
    edits.set_face_stock(tree, 7, 2.0)
    edits.toggle_keep_out(tree, 9)
    assert edits.plain(tree)["allowance"] == {
        "use": "milling", "outer": 0.4, "targets": [{"outer": 2.0, "faces": [7]}], "keep_out": [{"faces": [9]}],
    }  # fmt: skip
    edits.toggle_keep_out(tree, 9)
    assert "keep_out" not in tree["allowance"]


@given(st.lists(st.tuples(st.integers(1, 6), st.sampled_from(["accept", "drop", ""]), st.booleans()), max_size=12))
def test_a_site_has_one_choice_at_most(choices: list[tuple[int, str, bool]]) -> None:
    tree: dict[str, Any] = {}
    last: dict[int, tuple[str, bool]] = {}
    for number, choice, doubtful in choices:
        edits.choose_site(tree, number, choice, doubtful)
        last[number] = (choice, doubtful)
    dropped = {number for number, (choice, _) in last.items() if choice == "drop"}
    accepted = {number for number, (choice, doubtful) in last.items() if choice == "accept" and doubtful}
    assert set(tree.get("sites", {}).get("drop", [])) == dropped
    assert set(tree.get("accept", [])) == accepted


def test_datums_keep_their_precedence_and_a_second_click_takes_a_face_away(job: JobFile) -> None:
    def click(face: int, letter: str = "") -> Any:
        assert job.edit(lambda tree: edits.toggle_datum(tree, face, letter), allow)
        return job.values["align"].get("datum")

    assert click(3) == [3]
    assert click(5, "B") == {"A": [3], "B": [5]}
    assert list(click(7, "C").items()) == [("A", [3]), ("B", [5]), ("C", [7])]
    assert click(3, "B") == {"B": [5, 3], "C": [7]}  # a face belongs to one datum
    assert click(7, "C") == {"B": [5, 3]}
    assert click(9) == [5, 3, 9]
    for face in (5, 3):
        click(face)
    assert click(9) is None


def test_how_a_datum_is_fitted_stays(job: JobFile) -> None:
    job.path.write_text(TEXT.replace("align: register", "align: {use: icp, datum: {A: {skin: [1], fit: one_sided}}}"))
    job.reload()
    assert job.edit(lambda tree: edits.toggle_datum(tree, 2, "A"), allow)
    assert job.values["align"] == {"use": "icp", "datum": {"A": {"skin": [1, 2], "fit": "one_sided"}}}
