"""The moved skin follows the part at the clearance, or it is refused."""

from __future__ import annotations

import igl
import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS

from damageest.artefacts import Mesh, Part
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.stages.background.offset import Offset
from tests.stages._open import bowl


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["cuboid", *(pytest.param(name, marks=pytest.mark.slow) for name in ("gear", "tube", "half_torus"))]
)
def test_runs_beside_the_part_at_the_clearance(name: str) -> None:
    part = PARTS[name]()
    tolerance = 0.002 * part.diagonal
    inside = Mesh(part.vertices[:3] * 0.99, np.array([[0, 1, 2]]))
    moved = Offset().run(part, inside, tolerance, 0.1 * tolerance, True)
    middles = moved.triangles.mean(axis=1)
    distance, _ = signed_distance(middles, part)
    # Flat faces move by the clearance exactly; at corners the skin is farther out. Only chords of round faces are
    # nearer.
    assert np.median(distance) == pytest.approx(2 * tolerance, rel=0.02)
    assert distance.min() > 0.5 * tolerance
    assert distance.max() < 3.5 * 2 * tolerance
    winding = igl.fast_winding_number(np.array(moved.vertices), np.array(moved.faces), np.array(part.vertices))
    assert winding.min() > 0.5


def test_a_part_whose_moved_skin_meets_itself_is_held() -> None:
    """The bars of a grille stand so near that moved vertices came to lie inside other bars' skin, turned inside out."""
    part = PARTS["grille"]()
    inside = Mesh(part.vertices[:3] * 0.99, np.array([[0, 1, 2]]))
    held = Offset().run(part, inside, 0.008 * part.diagonal, 0.003 * part.diagonal, False)
    winding = igl.fast_winding_number(np.array(held.vertices), np.array(held.faces), np.array(part.vertices))
    assert winding.min() > 0.5
    assert held.volume > part.volume


@pytest.mark.slow
def test_bounded_however_small_the_tolerance() -> None:
    part = PARTS["cuboid"]()
    assert len(Offset().run(part, bowl(6, 10, 0.01), 1e-3, 1e-3, True).faces) < 500_000


@pytest.mark.slow
def test_a_surface_outside_is_refused() -> None:
    box = trimesh.creation.box((40, 30, 20))
    with pytest.raises(StageError, match="does not contain") as caught:
        Offset().run(Part(box.vertices, box.faces), bowl(6, 25, 0.5), 0.1, 0.1, True)
    assert "minkowski" in caught.value.remedy
