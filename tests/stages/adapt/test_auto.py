"""Stage `adapt: auto`: tried where the diagnosis asks, kept where it is borne out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import AdaptedPart, Part
from damageest.errors import StageError
from damageest.stages.adapt.auto import AutoAdapt
from damageest.stages.adapt.smooth import Smooth
from tests.stages.adapt.test_smooth import PART, SPHERE, scan

JOB = {"version": 1, "units": "mm", "tolerance": 0.2, "align": "icp", "report": "none"}


def run(folder: Path, use: str, given: Any) -> dict[str, bytes]:
    """The files that a job writes, but for those that tell its settings and times."""
    damageest.run(JOB, part=PART, scan=given, settings=[f"adapt={use}"], output=folder)
    return read_solids(folder)


def read_solids(folder: Path) -> dict[str, bytes]:
    kept = ("damage", "sites", "deposit", "undamaged")
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name.startswith(kept)
    }


@pytest.mark.slow
def test_a_part_as_designed_is_not_even_tried(small_done: Path, tmp_path: Path, monkeypatch: Any) -> None:
    def refuse(*_: Any) -> AdaptedPart | None:
        raise AssertionError("it was tried")

    monkeypatch.setattr(AutoAdapt, "run", lambda self, part, aligned, tolerance: refuse())
    damageest.run(small_done, settings=["adapt=auto"], output=tmp_path / "auto", cache=False)
    # the finished job has no adapted part (see test_none.py)
    rigid, auto = read_solids(small_done.parent / "out/job"), read_solids(tmp_path / "auto")
    assert rigid
    assert rigid == auto


@pytest.mark.slow
def test_what_is_not_borne_out_leaves_the_rigid_result(tmp_path: Path, monkeypatch: Any) -> None:
    tried = []
    given = scan([SPHERE], bend=0.3)

    def give_up(self: Any, part: Part, aligned: Any, tolerance: float) -> AdaptedPart | None:
        tried.append(part)
        return None

    monkeypatch.setattr(AutoAdapt, "run", give_up)
    rigid, auto = (run(tmp_path / use, use, given) for use in ("none", "auto"))
    assert tried
    assert rigid
    assert rigid == auto


@pytest.mark.slow
def test_a_field_that_would_fold_the_part_leaves_the_rigid_result(tmp_path: Path, monkeypatch: Any) -> None:
    def fold(self: Any, part: Part, aligned: Any, tolerance: float) -> AdaptedPart | None:
        raise StageError("the field would fold the part")

    given = scan([SPHERE], bend=1.0)
    monkeypatch.setattr(AutoAdapt, "run", fold)
    rigid, auto = (run(tmp_path / use, use, given) for use in ("none", "auto"))
    assert rigid == auto
    found = damageest.run(JOB, part=PART, scan=given)
    assert any(note.code == "adapt" and "not adapted: the field would fold" in note.text for note in found.warnings)
    monkeypatch.setattr(Smooth, "run", fold)
    with pytest.raises(StageError, match="fold"):  # what was asked for by name is no guess
        damageest.run(JOB, part=PART, scan=given, settings=["adapt=smooth"])


@pytest.mark.slow
def test_a_bent_part_is_adapted(tmp_path: Path) -> None:
    found = damageest.run(
        JOB | {"align": "none"},
        part=PART,
        scan=scan(bend=1.0),
        settings=["adapt=auto", "adapt.points=1500", "adapt.lattice=[]"],
    )
    assert found.adapted is not None
    assert not found.sites
    assert np.isclose(found.adapted.amount, 1.0, rtol=0.2)


@pytest.mark.slow
def test_a_pose_that_is_refused_since_the_part_is_deformed_is_found(tmp_path: Path) -> None:
    given, settings = scan([SPHERE], scale=1.0), ["align=register"]
    with pytest.raises(StageError, match="the scale is wrong") as refused:
        damageest.run(JOB, part=PART, scan=given, settings=[*settings, "adapt=none"])
    found = damageest.run(JOB, part=PART, scan=given, settings=settings)
    assert found.adapted is not None
    assert [site.verdict.level for site in found.sites] == ["likely"]
    assert found.truth is not None
    rod = trimesh.creation.cylinder(14.0, 40.0)
    other = Part(rod.vertices, rod.faces)
    with pytest.raises(StageError) as again:
        damageest.run(JOB, part=other, scan=given, settings=settings)
    assert again.value.stage == refused.value.stage == "align"
