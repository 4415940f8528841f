"""Faces and skin that a job selects are checked against the part before anything is computed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

import damageest
from damageest.cli import app
from damageest.errors import JobError
from tests import damaged_box
from tests.needs import needs_plugin
from tests.stages.allowance.test_milling_options import block, named

MILLING = """allowance:
  use: milling
  targets:
    - {WHERE, outer: 0.5}
"""
NO_SKIN = "no skin of the part is selected by "


def validate(path: Path) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["validate", str(path)])
    return done.exit_code, done.output


def write_job(folder: Path, where: str, part: str = "box.stl") -> Path:
    text = damaged_box.JOB.replace("part: box.stl", f"part: {part}") + MILLING.replace("WHERE", where)
    return damaged_box.write(folder, text, 60)


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("facing: {direction: [0, 0, 1], angle: 5}", ""),
        ("box: [[-20, -15, 9.9], [20, 15, 11]]", ""),
        ("box: [[1, 1, 10], [2, 2, 10.5]]", ""),  # smaller than the triangle that it lies on
        ("box: [[1, 1, 1], [2, 2, 2]]", NO_SKIN + "box: the nearest skin is at (1.5, 1.5, 10)"),
        ("box: [[500, 0, 0], [600, 10, 10]]", NO_SKIN + "box: the nearest skin is at (20, 5, 5)"),
        ("facing: {direction: [1, 1, 1], angle: 20}", NO_SKIN + "facing"),
        (
            "half_space: {point: [0, 0, 9], normal: [0, 0, 1]}, facing: {direction: [0, 0, -1]}",
            NO_SKIN + "half_space and facing",
        ),
        ("faces: [3]", "'faces' selects CAD faces, but the part is a mesh and has none; give the part as STEP"),
    ],
)
def test_validate_and_run_say_the_same(tmp_path: Path, where: str, message: str) -> None:
    path = write_job(tmp_path, where)
    status, text = validate(path)
    if not message:
        assert (status, "valid; method" in text) == (0, True), text
        return
    assert status == 2
    assert f"job.yaml:10:7: allowance.targets.0: {message}" in text
    (tmp_path / "scan.ply").write_text("not a scan")  # so it is not even read
    with pytest.raises(JobError) as caught:
        damageest.run(path)
    assert caught.value.lines() == [line for line in text.splitlines() if line and not line.startswith("help: ")]


def test_skin_to_keep_free_and_datums_are_checked_too(tmp_path: Path) -> None:
    path = write_job(tmp_path, "facing: {direction: [0, 0, 1]}")
    job = path.read_text().replace(
        "align: none", "align: {use: register, datum: [{box: [[90, 90, 90], [91, 91, 91]]}]}"
    )
    path.write_text(job + "  keep_out: [{box: [[90, 0, 0], [99, 9, 9]]}, {facing: {direction: [1, 1, 0], angle: 9}}]\n")
    status, text = validate(path)
    assert status == 2
    assert "allowance.keep_out.1: " + NO_SKIN + "facing" in text
    assert "align.datum.0: " + NO_SKIN + "box" in text
    assert "allowance.keep_out.0: this solid is 70 from the box of the part, x -20 to 20" in text


def test_names_are_checked_in_a_part_from_python(tmp_path: Path) -> None:
    job = {"version": 1, "allowance": {"use": "milling", "targets": [{"faces": ["topp", 9, "top"], "outer": 1}]}}
    with pytest.raises(JobError, match=r"targets.0: no CAD face 'topp' \(did you mean 'top'\?\)"):
        damageest.run({**job, "part": named(block()), "scan": damaged_box.scan(100)})


@pytest.fixture(scope="module")
def pocket(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pocket") / "pocket.step"
    write_pocket(path)
    assert validate(write_job(path.parent, "kind: cylinder", path.name))[0] == 0  # the part is kept from now on
    return path


@pytest.mark.slow
@needs_plugin("cadquery")
@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("faces: [pocket_floor, 5]", ""),
        ("faces: [pocket_flor]", "no CAD face 'pocket_flor' (did you mean 'pocket_floor'?); give one of the names"),
        ("faces: [99]", "the part has no CAD face 99; give a number from 0 to 12"),
        ("faces: [pocket_floor], kind: cylinder", NO_SKIN + "faces and kind"),
        ("box: [[-5, -4, 4], [5, 4, 4.5]]", NO_SKIN + "box: the nearest CAD faces are "),
    ],
)
def test_faces_of_a_step_file(pocket: Path, tmp_path: Path, where: str, message: str) -> None:
    path = write_job(tmp_path, where, "pocket.step")
    shutil.copy(pocket, tmp_path / "pocket.step")
    status, text = validate(path)
    assert status == (2 if message else 0), text
    assert message in text


def write_pocket(path: Path) -> None:
    """A box with a pocket, whose floor has a name, and a bore."""
    import cadquery as cq

    body = cq.Workplane("XY").box(40, 30, 20).faces(">Z").workplane().rect(12, 10).cutBlind(-5)
    body = body.faces(">X").workplane().hole(4, 6)
    cq.exporters.export(body, str(path))
    text = path.read_text()
    faces = [line for line in text.splitlines() if "ADVANCED_FACE" in line]
    floor = faces[FLOOR]
    path.write_text(text.replace(floor, floor.replace("ADVANCED_FACE(''", "ADVANCED_FACE('pocket_floor'")))


FLOOR = 7
"""Any one of its plane faces."""
