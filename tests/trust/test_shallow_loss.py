"""Where nothing is found, the high end of the total is what may lie below the tolerance."""

from __future__ import annotations

import numpy as np
import pytest

import damageest
from damageest.artefacts import Scan
from tests.damaged_box import box

NOISE = 0.03


def scan_box(deep: float) -> np.ndarray:
    """Points (N,3) of the skin of the box, with a round place of radius 6 in its top that is ``deep``."""
    part, rng = box(), np.random.default_rng(0)
    low, high = part.bounds
    points = []
    for axis in range(3):
        for side in (low, high):
            some = rng.uniform(low, high, (1500, 3))
            some[:, axis] = side[axis] + rng.normal(0, NOISE, 1500)
            points.append(some)
    found = np.concatenate(points)
    top = (found[:, 2] > high[2] - 0.5) & (np.hypot(found[:, 0], found[:, 1]) < 6)
    found[top, 2] -= deep
    return found


@pytest.mark.variants(1)
@pytest.mark.parametrize(("deep", "tolerance"), [(0.0, 0.2), (0.15, 0.2), (0.8, 1.0)])
def test_the_high_end_holds_what_the_tolerance_hides(deep: float, tolerance: float) -> None:
    job = {"version": 1, "tolerance": tolerance}
    result = damageest.run(job, part=box(), scan=Scan(scan_box(deep)), settings=["align=none", "report=none"])
    assert not result.sites
    assert result.volume_95 is not None
    low, high = result.volume_95
    true = np.pi * 36 * deep
    assert low == 0
    assert true < high < 3 * true + 0.01 * tolerance * np.linalg.norm(box().cross, axis=1).sum() + 40
