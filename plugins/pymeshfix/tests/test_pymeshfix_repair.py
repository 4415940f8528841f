"""Flawed enclosures of known volume: repaired, or refused where the repaired one would have another shape."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from damageest_pymeshfix import damageest_stages
from damageest_pymeshfix.repair import PyMeshFix

import damageest
from damageest.artefacts import Mesh, Solid
from damageest.errors import StageError
from damageest.stages.scan.simulate import Simulate

BALL = trimesh.creation.icosphere(4, radius=3)
SMALL = trimesh.creation.icosphere(3, radius=1)
POINTS, FACES, HEIGHT = BALL.vertices, BALL.faces, BALL.triangles_center[:, 2]
TOLERANCE = 0.05


def repair(points: np.ndarray, faces: np.ndarray, **options: float) -> Solid:
    return PyMeshFix(**options).run(Mesh(points, faces), TOLERANCE)


def flip(some: slice) -> np.ndarray:
    faces: np.ndarray = FACES.copy()
    faces[some] = faces[some][:, ::-1]
    return faces


def beside(faces: np.ndarray, step: tuple[float, float, float], other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The ball, and a small one moved by ``step``, as one mesh."""
    return np.vstack([POINTS, SMALL.vertices + step]), np.vstack([faces, other + len(POINTS)])


def test_watertight_passes_unchanged() -> None:
    solid = repair(POINTS, FACES)
    assert np.array_equal(solid.vertices, POINTS)
    assert np.array_equal(solid.faces, FACES)


@pytest.mark.parametrize(
    ("points", "faces"),
    [
        (POINTS, FACES[20:]),
        (POINTS, flip(slice(None, None, 7))),
        (POINTS, flip(slice(100, 600))),
        (POINTS, flip(slice(None))),
        (POINTS, np.vstack([FACES, FACES[:3]])),
        (POINTS, FACES[np.abs(HEIGHT) > 0.05]),
        (POINTS[FACES].reshape(-1, 3), np.arange(3 * len(FACES)).reshape(-1, 3)),
    ],
    ids=["hole", "flipped", "flipped patch", "inside out", "doubled", "slit in two", "corners apart"],
)
def test_flaws_are_repaired_and_the_volume_stays(points: np.ndarray, faces: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"not watertight|inside out"):
        Solid(points, faces)
    assert repair(points, faces).volume == pytest.approx(BALL.volume, rel=1e-4)


def test_vertices_that_no_triangle_uses_do_not_count() -> None:
    solid = repair(np.vstack([POINTS, [[50, 0, 0]]]), FACES[20:])
    assert solid.volume == pytest.approx(BALL.volume, rel=1e-4)
    assert solid.vertices[:, 0].max() < 4


def test_two_triangles_back_to_back_on_an_edge_are_removed() -> None:
    a, b, c = FACES[0]
    points = np.vstack([POINTS, POINTS[[a, b, c]].mean(axis=0) * 1.005])  # within the tolerance of the ball
    flap = [[a, b, len(POINTS)], [b, a, len(POINTS)]]
    assert repair(points, np.vstack([FACES, flap, FACES[:1]])).volume == pytest.approx(BALL.volume, rel=1e-4)


def test_a_second_shell_is_kept() -> None:
    solid = repair(*beside(FACES[1:], (6, 0, 0), SMALL.faces[2:]))
    assert solid.volume == pytest.approx(BALL.volume + SMALL.volume, rel=1e-3)


def test_a_shell_inside_another_stays_a_cavity() -> None:
    solid = repair(*beside(FACES[1:], (0, 0, 0), SMALL.faces[:, ::-1]))
    assert solid.volume == pytest.approx(BALL.volume - SMALL.volume, rel=1e-3)


def test_shells_that_overlap_are_counted_once() -> None:
    solid = repair(*beside(FACES[1:], (3, 0, 0), SMALL.faces))
    assert BALL.volume + 0.4 * SMALL.volume < solid.volume < BALL.volume + 0.7 * SMALL.volume


def test_boxes_pinched_at_an_edge_both_stay() -> None:
    box = trimesh.creation.box((1, 1, 1)).subdivide().subdivide()
    points = np.vstack([box.vertices, box.vertices + np.array([1, 1, 0])])
    faces = np.vstack([box.faces, box.faces + len(box.vertices)])
    points, same = np.unique(points.round(9), axis=0, return_inverse=True)
    assert repair(points, same.reshape(-1)[faces]).volume == pytest.approx(2)


def test_far_from_the_origin() -> None:
    assert repair(POINTS + 1e6, FACES[1:]).volume == pytest.approx(BALL.volume, rel=1e-6)


def test_a_hole_too_large_to_fill_is_refused_unless_allowed() -> None:
    with pytest.raises(StageError, match="too large to be filled") as caught:
        repair(POINTS, FACES[HEIGHT < 2])
    assert "implicit" in caught.value.remedy
    cap = np.pi * 1**2 * (3 * 3 - 1) / 3
    assert repair(POINTS, FACES[HEIGHT < 2], max_new_area=1).volume == pytest.approx(BALL.volume - cap, rel=0.01)


def test_a_flat_patch_is_right_where_it_is_allowed() -> None:
    box = trimesh.creation.box((4, 4, 4)).subdivide().subdivide()
    middle = np.all([box.triangles_center[:, 2] > 1.9, *(np.abs(box.triangles_center[:, :2]) < 1).T], axis=0)
    with pytest.raises(StageError, match="too large"):
        repair(box.vertices, box.faces[~middle])
    assert repair(box.vertices, box.faces[~middle], max_new_area=0.1).volume == pytest.approx(64)


def test_a_fin_that_would_be_lost_is_refused() -> None:
    points, fin = np.vstack([POINTS, [[0, 0, 6]]]), [[FACES[0, 0], FACES[0, 1], len(POINTS)]]
    with pytest.raises(StageError, match="cannot be closed or joined"):
        repair(points, np.vstack([FACES, fin]))


@pytest.mark.parametrize("faces", [FACES[:0], FACES[:10], FACES[HEIGHT < 0]], ids=["empty", "a small piece", "half"])
def test_a_mesh_that_is_no_enclosure_is_refused(faces: np.ndarray) -> None:
    with pytest.raises(StageError) as caught:
        repair(POINTS, faces)
    assert "implicit" in caught.value.remedy


def test_same_mesh_same_bytes_and_no_output(capfd: pytest.CaptureFixture[str]) -> None:
    first, second = (repair(POINTS, flip(slice(5, 400))[30:]) for _ in range(2))
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_whole_job_with_it_comes_near_the_truth() -> None:
    mesh = trimesh.creation.box((40, 30, 20))
    part = damageest.artefacts.Part(mesh.vertices, mesh.faces)
    tool = {"tool": "sphere", "centre": [0, 0, 10], "radius": 6}
    scan = Simulate.model_validate({"damage": [tool], "points": 6000, "noise": 0.04}).run("mm", part)
    job = {"version": 1, "method": "surface", "tolerance": 0.2, "align": "none", "repair": "pymeshfix"}
    result = damageest.run(job, part=part, scan=scan)
    assert result.truth is not None
    assert result.truth[1] > 0.95


def test_the_stages_are_listed_without_importing_pymeshfix() -> None:
    assert damageest_stages() == [PyMeshFix]
    code = "import sys, damageest_pymeshfix as d; d.damageest_stages(); sys.exit('pymeshfix' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
