from __future__ import annotations

import pytest
from damageest_benchmarks.parts import PARTS
from damageest_evaluate.scores import measure_depth
from damageest_evaluate.sized import DEPTH_ERROR, SIZED, make_sized_damage

from damageest.geometry.solids import to_manifold


@pytest.mark.variants(2)
@pytest.mark.parametrize("kind", SIZED)
@pytest.mark.parametrize("deep", [0.1, 3.0])
def test_a_loss_is_as_deep_as_asked_for(kind: str, deep: float) -> None:
    part = PARTS["lever"]()
    made = make_sized_damage(part, 2, deep, kind)
    assert made.kinds == (kind,)
    assert measure_depth(made.damage, part) == pytest.approx(deep, rel=DEPTH_ERROR)
    assert (to_manifold(made.damage) - to_manifold(part)).volume() < 1e-9 * part.volume
    assert make_sized_damage(part, 2, deep, kind).damage.vertices.tobytes() == made.damage.vertices.tobytes()
    assert make_sized_damage(part, 3, deep, kind).tools != made.tools


@pytest.mark.slow
def test_deeper_than_the_walls_is_refused() -> None:
    with pytest.raises(LookupError, match="no damage with a depth of 40"):
        make_sized_damage(PARTS["cuboid"](), 0, 40)
