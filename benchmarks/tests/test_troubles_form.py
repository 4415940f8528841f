"""The kinds of form: their scenes hold what they say."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.troubles.form import FORM_TROUBLES
from damageest_benchmarks.troubles.kinds import TROUBLES
from damageest_benchmarks.troubles.scene import Scanning

from damageest.geometry.distance import distance_to_mesh


def test_there_are_enough_cases_on_enough_parts_in_both_poses() -> None:
    ways = [way for trouble in FORM_TROUBLES.values() for way in trouble.ways]
    assert len(ways) >= 32
    assert len({way.part for way in ways}) >= 6
    assert {way.pose for way in ways} == {"known", "unknown"}
    assert set(FORM_TROUBLES) <= set(TROUBLES)


@pytest.mark.parametrize(("kind", "amount"), [("form: bent", 3.0), ("form: twisted", 3.0)])
def test_a_deformed_part_deviates_by_its_amount(kind: str, amount: float) -> None:
    case = Scanning("plate", 0, points=2000, amount=amount)
    scene = FORM_TROUBLES[kind].make(case)
    assert scene.damage is None
    far = distance_to_mesh(scene.points, case.part)
    assert 0.4 * amount * case.tolerance < far.max() < 2.5 * amount * case.tolerance


def test_one_view_is_misplaced() -> None:
    case = Scanning("rib_bracket", 0, views=8, points=2000, amount=4.0)
    scene = FORM_TROUBLES["form: view misplaced, with a pit"].make(case)
    assert scene.view is not None
    assert scene.damage is not None
    far = np.array([np.median(distance_to_mesh(scene.points[scene.view == number], case.part)) for number in range(8)])
    assert int(np.argmax(far)) == 1
