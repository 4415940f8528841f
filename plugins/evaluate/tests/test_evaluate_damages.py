from __future__ import annotations

import pytest
import trimesh
from damageest_benchmarks.parts import PARTS
from damageest_evaluate.damages import KINDS, SHARE, make_random_damage
from damageest_evaluate.scores import iou, measure_depth

from damageest.artefacts import Part
from damageest.geometry.solids import to_manifold
from damageest.stages.scan.simulate import Simulate


@pytest.mark.variants(3)
@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("name", ["tube", "lever"])
def test_each_kind_makes_a_loss_of_its_size(kind: str, name: str) -> None:
    part = PARTS[name]()
    made = make_random_damage(part, 1, (kind,), count=1)
    assert made.kinds == (kind,)
    assert SHARE[0] < made.damage.volume / part.volume < SHARE[1]
    assert measure_depth(made.damage, part) >= 0.008 * part.diagonal
    assert (to_manifold(made.damage) - to_manifold(part)).volume() < 1e-9 * part.volume


def test_a_thin_wall_is_broken_through() -> None:
    outer, inner = trimesh.creation.box((40, 30, 20)), trimesh.creation.box((39.2, 29.2, 30))
    cup = trimesh.boolean.difference([outer, inner])
    part = Part(cup.vertices, cup.faces, "mm")
    made = make_random_damage(part, 0, ("end",), count=1)
    assert made.kinds == ("end",)
    assert 0.7 * 0.2 < measure_depth(made.damage, part) <= 0.2


@pytest.mark.slow
def test_a_damage_repeats_and_is_what_the_virtual_scanner_takes_off() -> None:
    part = PARTS["coupling"]()
    a, b, other = make_random_damage(part, 7), make_random_damage(part, 7), make_random_damage(part, 8)
    assert a.tools == b.tools != other.tools
    assert a.damage.vertices.tobytes() == b.damage.vertices.tobytes()
    scan = Simulate(damage=a.tools, points=1000).run("mm", part)
    assert scan.truth is not None
    assert scan.truth.damage is not None
    assert iou([scan.truth.damage], [a.damage]) == pytest.approx(1)


def test_the_number_of_losses() -> None:
    made = make_random_damage(PARTS["block"](), 3, ("pit", "chip"), count=2)
    assert made.kinds == ("pit", "chip")
    assert len(made.tools) == 2
