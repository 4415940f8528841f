"""Datums and the steps after the alignment: what moves a pose by datums says so, or fits it to them again."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import AdaptedPart, Floats, Part, Pose, Scan
from damageest.pipeline.placing.datums import note_datums
from damageest.pipeline.state import JobState
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.align.icp import Icp
from tests.pipeline.halfway import run_until

SIZE, NOISE, TOLERANCE = np.array([60.0, 30.0, 20.0]), 0.04, 0.16
CORNERS = np.array(list(product([-30, 0], [-15, 15], [-10, 10])), float)
"""Of the end of the part that has the datums."""


def box(*corners: list[float]) -> list[dict[str, Any]]:
    return [{"box": list(corners)}]


DATUMS = {
    "A": box([-31, -16, -10.01], [0, 16, -9.99]),
    "B": box([-31, -15.01, -11], [0, -14.99, 11]),
    "C": box([-30.01, -16, -11], [-29.99, 16, 11]),
}


def make_part() -> Part:
    """A block with an end that is cut away aslant, so that it fits in one way only."""
    corners = np.array(list(product([-30.0, 30.0], [-15.0, 15.0], [-10.0, 10.0])))
    corners[[5, 7]] = [[24.0, -15.0, 10.0], [18.0, 8.0, 10.0]]
    mesh = trimesh.convex.convex_hull(corners)
    return Part(mesh.vertices, mesh.faces)


def draw(count: int) -> Floats:
    part = make_part()
    mesh = trimesh.Trimesh(part.vertices, part.faces, process=False)
    points, _ = trimesh.sample.sample_surface(mesh, count, seed=0)
    return np.asarray(points)


def add_noise(points: Floats) -> Floats:
    return points + np.random.default_rng(0).normal(scale=NOISE, size=points.shape)


def run_until_adapted(points: Floats, registry: Registry, datum: Any, adapt: str) -> JobState:
    """What is known after the notes on datums."""
    align = {"use": "icp", "datum": datum}
    scan = Scan(add_noise(points))
    return run_until(
        "settle_tolerance", make_part(), scan, registry, tolerance=TOLERANCE, align=align, adapt=adapt
    ).state


def run(points: Floats, view: Any = None, **job: Any) -> Result:
    scan = Scan(
        add_noise(points), viewpoints=None if view is None else np.array([[-200.0, 0, 50], [200, 0, 50]]), view=view
    )
    return damageest.run({"version": 1, "tolerance": TOLERANCE, "report": "none", **job}, part=make_part(), scan=scan)


def measure_off(pose: Pose) -> float:
    """How far the end with the datums lies from its place."""
    T = pose.T_part_scan
    return float(np.linalg.norm(CORNERS @ T[:3, :3].T + T[:3, 3] - CORNERS, axis=1).max())


def draw_bent() -> Floats:
    """Its end without datums is bent."""
    points = draw(3000)
    points[:, 2] += 0.0006 * np.maximum(points[:, 0], 0) ** 2
    return points


LIST = [one for items in DATUMS.values() for one in items]


@pytest.mark.slow
@pytest.mark.parametrize("datum", [DATUMS, LIST], ids=["system", "list"])
def test_an_adapted_part_that_moves_the_pose_off_its_datums_is_named(datum: Any, registry: Registry) -> None:
    moved = run_until_adapted(draw_bent(), registry, datum, "smooth")
    (note,) = [note for note in moved.warnings if note.code == "datum_moved"]
    assert note.amount is not None
    assert note.amount >= measure_off(moved.pose) > TOLERANCE / 4


@pytest.mark.parametrize(("shift", "is_told"), [(0.02, True), (0.01, False)])
def test_an_adapted_part_that_takes_the_datums_along_is_told(shift: float, is_told: bool) -> None:
    """Where it moves them by more than a tenth of the tolerance, 0.16, and the job names datums."""
    part, motion = make_part(), np.eye(4)
    motion[2, 3] = shift
    rest = np.zeros(part.vertices.shape)
    adapted = AdaptedPart(part, rest, motion, np.zeros((2, *rest.shape)), 0.3, 0.1, 0.01, 0.01, (4, 3, 2))
    for datum in (DATUMS, LIST, None):
        aligner = Icp.model_validate({"datum": datum} if datum else {})
        notes = note_datums(adapted, aligner, part, TOLERANCE, "mm")
        assert [note.code for note in notes] == ["datum_moved"] * (is_told and datum is not None)
        assert all(note.amount == pytest.approx(shift) for note in notes)


@pytest.mark.variants(1)
@pytest.mark.parametrize("datum", [DATUMS, LIST], ids=["system", "list"])
def test_a_part_as_designed_keeps_its_datums(datum: Any, registry: Registry) -> None:
    held = run_until_adapted(draw_bent(), registry, datum, "none")
    assert measure_off(held.pose) < NOISE / 2
    assert "datum_moved" not in [note.code for note in held.warnings]


@pytest.mark.slow
def test_datums_are_fitted_again_after_views_were_put_right() -> None:
    """Half of the datums is in a view that lies off by three tolerances."""
    points = draw(16_000)
    view = (points[:, 0] + np.random.default_rng(1).uniform(-14, 14, len(points)) > -12).astype(np.int32)
    points[view == 1, 2] += 3 * TOLERANCE
    result = run(points, view, align={"use": "register", "datum": DATUMS}, adapt="none")
    assert result.fit is not None
    assert any(one.is_corrected for one in result.fit.views)
    bottom = points[:, 2] - 3 * TOLERANCE * view < -9.999
    assert result.aligned.points[bottom, 2].mean() == pytest.approx(-10, abs=NOISE / 4)
    assert "datum_moved" not in [note.code for note in result.warnings]
