"""The cylinder finds its axis in any pose and keeps the clearance."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from damageest.artefacts import Part, Surface
from damageest.stages.background.capsule import Capsule
from damageest.stages.background.cylinder import CylinderBackground
from tests.stages._open import bowl
from tests.stages.background.holding import measure_gap, measure_longest_edge

RADIUS, LENGTH, CLEARANCE = 10.0, 40.0, 1.0


def rod(turn: np.ndarray, away: np.ndarray) -> tuple[Part, Surface]:
    mesh = trimesh.creation.cylinder(RADIUS, LENGTH, sections=64)
    dent = bowl(3, LENGTH / 2, 0.5)
    move = lambda points: points @ turn.T + away  # noqa: E731
    return Part(move(mesh.vertices), mesh.faces), Surface(move(dent.vertices), dent.faces)


@pytest.mark.parametrize("seed", [None, 1, 2])
@pytest.mark.parametrize("kind", [CylinderBackground, Capsule])
def test_keeps_close_to_a_rod_in_any_pose(kind: type, seed: int | None) -> None:
    turn = np.eye(3) if seed is None else Rotation.random(random_state=seed).as_matrix()
    part, surface = rod(turn, np.array([0, 0, 0]) if seed is None else np.array([300.0, -200.0, 5000.0]))
    found = kind().run(part, surface, 0.5, 0.1, False)
    nearest, holds = measure_gap(found, part, surface)
    assert holds
    assert nearest > 0.98 * CLEARANCE
    wide = RADIUS + CLEARANCE
    least = np.pi * wide**2 * (LENGTH + 2 * CLEARANCE if kind is CylinderBackground else LENGTH)
    dome = 4 / 3 * np.pi * wide**3 if kind is Capsule else 0.0
    assert least * 0.97 < found.volume < 1.03 * (least + dome)


def test_an_axis_may_be_given() -> None:
    part, surface = rod(np.eye(3), np.zeros(3))
    slim = CylinderBackground(axis="z").run(part, surface, 0.5, 0.1, False)
    wide = CylinderBackground(axis="x").run(part, surface, 0.5, 0.1, False)
    same = CylinderBackground(axis=(0, 0, 2)).run(part, surface, 0.5, 0.1, False)
    assert slim.volume == pytest.approx(same.volume)
    assert wide.volume > 1.3 * slim.volume
    with pytest.raises(ValueError, match="not all three numbers may be 0"):
        CylinderBackground(axis=(0, 0, 0))


def test_fine_everywhere_where_enclose_needs_it() -> None:
    part, surface = rod(np.eye(3), np.zeros(3))
    assert measure_longest_edge(CylinderBackground().run(part, surface, 0.5, 0.1, True)) <= 1.5
