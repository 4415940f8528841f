"""Repaired workpieces are wrong where the family says, and only there."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.repaired.scenes import KINDS, TOLERANCE, Draw, make_workpiece

from damageest.geometry.distance import signed_distance
from damageest.geometry.solids import to_solid


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_sites_lie_on_the_skin_and_are_lost(seed: int) -> None:
    work = make_workpiece(seed)
    whole = to_solid(work.body, np.zeros(3))
    assert whole is not None
    on_skin = np.concatenate([work.places, work.rest[None]])
    assert np.abs(signed_distance(on_skin, whole)[0]).max() < 0.05
    assert whole.volume - work.lose().volume() > 100


@pytest.mark.variants(4)
@pytest.mark.parametrize("kind", list(KINDS))
def test_a_kind_is_wrong_where_it_says(kind: str) -> None:
    work = make_workpiece(1)
    whole = to_solid(work.body, np.zeros(3))
    assert whole is not None
    draw = Draw(work, 7)
    draw.spacing = 0.8
    repaired = KINDS[kind](draw)
    points = repaired.points
    distance, away = signed_distance(points, whole)[0], np.linalg.norm(points - draw.middle, axis=1)
    off = np.abs(distance) > 1.3 * TOLERANCE
    if repaired.is_perfect:
        if "fixture" in kind:
            off &= np.linalg.norm(points - work.rest, axis=1) > 60
        assert not off.any()
    elif repaired.wrong:
        assert repaired.wrong == (draw.site,)
        assert off[away < 5].sum() > 5
    elif repaired.blind == (draw.site,):
        assert away.min() >= 2.6
    assert "sparse" not in kind or len(points) < 3200
