"""The box holds part and damage surface, finely enough."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Part
from damageest.stages.background.bbox import BoundingBox
from tests.stages._open import bowl


@pytest.fixture
def part() -> Part:
    box = trimesh.creation.box((40, 30, 20))
    return Part(box.vertices, box.faces)


def longest_edge(vertices: np.ndarray, faces: np.ndarray) -> float:
    corners = vertices[faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())


def test_holds_both_with_the_clearance(part: Part) -> None:
    surface = bowl(6, 15, 0.5)  # reaches above the part
    box = BoundingBox(clearance=3).run(part, surface, 0.5, 0.1, True)
    low = np.minimum(part.bounds[0], surface.bounds[0])
    high = np.maximum(part.bounds[1], surface.bounds[1])
    assert np.allclose(box.bounds, [low - 1.5, high + 1.5])
    assert box.volume == pytest.approx(np.prod(np.ptp(box.bounds, axis=0)))
    assert longest_edge(box.vertices, box.faces) <= 2.0


def test_a_tiny_tolerance_does_not_fill_the_memory(part: Part) -> None:
    box = BoundingBox().run(part, bowl(6, 10, 0.01), 1e-4, 1e-3, True)
    assert len(box.faces) < 500_000


def test_a_sparse_scan_widens_the_clearance(part: Part) -> None:
    box = BoundingBox().run(part, bowl(6, 10, 0.1), 0.1, 2.0, True)
    assert np.allclose(box.bounds[0], part.bounds[0] - 3.0)
