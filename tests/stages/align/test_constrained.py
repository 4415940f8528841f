"""The constrained best fit: allowed motions are found, others stay as they were, and weighted regions decide."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats, Part, Pose, Scan
from damageest.errors import StageError
from damageest.stages.align.constrained import Constrained

NOISE, TOLERANCE = 0.02, 0.1


def make_part() -> Part:
    mesh = trimesh.creation.box([40, 30, 20])
    return Part(mesh.vertices, mesh.faces)


def draw(T: Floats, raised: float = 0.0) -> Scan:
    """A scan that the motion ``T`` (4,4) takes onto the part, but for a top that lies ``raised`` too high."""
    part = make_part()
    points = np.asarray(
        trimesh.sample.sample_surface(trimesh.Trimesh(part.vertices, part.faces, process=False), 6000, seed=2)[0]
    )
    points[points[:, 2] > 9.999, 2] += raised
    points = points + np.random.default_rng(2).normal(scale=NOISE, size=points.shape)
    return Scan((points - T[:3, 3]) @ T[:3, :3], noise=NOISE, spacing=0.9)


def move(turn: Floats | list[float], shift: Floats | list[float]) -> Floats:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    T[:3, 3] = shift
    return T


def fit(scan: Scan, **options: Any) -> Pose:
    return Constrained.model_validate(options).run(scan, make_part(), TOLERANCE)


@pytest.mark.parametrize(
    ("turn", "shift", "options"),
    [
        ([0, 0, 0], [0, 0, 0.6], {"shift": ["z"]}),
        ([0, 0, 0.03], [0, 0, 0], {"turn": ["z"]}),
        ([0, 0.02, 0], [0.5, 0, -0.4], {"turn": ["y"], "shift": ["x", "z"]}),
        ([0.01, 0.02, -0.01], [0.2, 0.3, -0.4], {"turn": ["x", "y", "z"], "shift": ["x", "y", "z"]}),
    ],
)
def test_allowed_motions_are_found(turn: list[float], shift: list[float], options: dict[str, Any]) -> None:
    T = move(turn, shift)
    assert fit(draw(T), **options).T_part_scan == pytest.approx(T, abs=NOISE / 10)


def test_what_is_not_allowed_stays_and_is_told() -> None:
    pose = fit(draw(move([0, 0, 0], [0.08, 0, 0.5])), shift=["z"])
    assert pose.T_part_scan[:3, :3] == pytest.approx(np.eye(3), abs=0)
    assert pose.T_part_scan[:2, 3] == pytest.approx([0, 0], abs=0)
    assert pose.T_part_scan[2, 3] == pytest.approx(0.5, abs=NOISE / 10)
    assert "only these motions were fitted: shift z" in pose.notes[0]
    assert "would move by up to 0.0" in pose.notes[0]


def test_a_turn_about_a_point_leaves_it_in_place() -> None:
    T, at = move([0, 0, 0.02], [0, 0, 0]), np.array([20.0, 15.0, 0.0])
    T[:3, 3] = at - T[:3, :3] @ at
    pose = fit(draw(T), turn=["z"], pivot=at.tolist())
    assert pose.T_part_scan == pytest.approx(T, abs=NOISE / 10)


def test_regions_count_by_their_weights() -> None:
    """Top and bottom contradict each other by 0.03: alone, either is right; by weights 3 to 1, three quarters of it."""
    scan, top = draw(np.eye(4), raised=0.03), {"facing": {"direction": [0, 0, 1], "angle": 5}}
    heights = {
        weight: fit(scan, shift=["z"], weights=[{"skin": top, "weight": weight}]).T_part_scan[2, 3]
        for weight in (0, 1, 3, 1000)
    }
    expected = {0: 0.0, 1: -0.015, 3: -0.0225, 1000: -0.03}
    assert heights == pytest.approx(expected, abs=0.003)


def test_a_scan_that_no_allowed_motion_brings_onto_the_part_is_refused() -> None:
    with pytest.raises(StageError, match="allowed motions"):
        fit(draw(move([0, 0, 0.3], [3, 0, 0])), shift=["z"])
    with pytest.raises(ValidationError, match="no motion is allowed"):
        Constrained.model_validate({})
