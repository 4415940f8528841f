from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.parts import CHORD, PARTS

from damageest.geometry.solids import to_manifold


@pytest.mark.parametrize("name", sorted(PARTS))
def test_each_part_is_one_solid_of_its_size(name: str) -> None:
    part, again = PARTS[name](), PARTS[name]()
    extent = part.bounds[1] - part.bounds[0]
    assert len(to_manifold(part).decompose()) == 1
    assert 50 <= extent.max() <= 130
    assert part.diagonal * 0.0002 > CHORD
    assert part.vertices.tobytes() == again.vertices.tobytes()
    assert part.faces.tobytes() == again.faces.tobytes()


def test_volumes_that_are_known() -> None:
    assert PARTS["cuboid"]().volume == pytest.approx(70 * 50 * 30, rel=1e-12)
    assert PARTS["cylinder"]().volume == pytest.approx(np.pi * 400 * 90, rel=1e-3)


def test_the_gear_fits_onto_itself_only_with_its_keyway() -> None:
    gear = to_manifold(PARTS["gear"]())
    turned = gear.rotate((0, 0, 18))
    # a turn by one tooth changes nothing but the keyway, 6 wide and about 3 deep, 18 long
    differs = gear.volume() - (gear ^ turned).volume()
    assert 0 < differs < 6 * 4 * 18 * 1.2
    assert (gear ^ gear.rotate((0, 0, 9))).volume() < 0.98 * gear.volume()
