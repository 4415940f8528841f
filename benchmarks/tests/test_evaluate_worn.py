"""Worn parts are worn by what the family says, where it says."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.real.worn import FORMS, KINDS, make_worn

from damageest.geometry.distance import signed_distance


@pytest.mark.parametrize(
    "kind", ["rail", *(pytest.param(one, marks=pytest.mark.slow) for one in KINDS if one != "rail")]
)
def test_a_part_is_worn_by_less_than_a_millimetre_in_one_place(kind: str) -> None:
    worn = make_worn(kind, 3)
    assert 0 < worn.deep < worn.whole
    assert 0.2 < worn.depths.max() <= 0.6
    assert worn.depths.min() == 0.0
    # the scan stands elsewhere, and is the part but for wear and form: as large as it is
    size = [np.ptp(np.linalg.norm(one - one.mean(axis=0), axis=1)) for one in (worn.scan.points, worn.places)]
    assert size[0] == pytest.approx(size[1], rel=0.15)
    assert np.abs(signed_distance(worn.places, worn.part)[0]).max() < 1e-6
    assert max(FORMS) < 0.2
