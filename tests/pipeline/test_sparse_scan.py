"""Points farther apart than the tolerance: no volume holds metal that the scan does not show as lost, or as added."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from damageest.artefacts import Scan
from damageest.geometry.solids import to_manifold
from damageest.registry import Registry
from damageest.result import Result
from tests.pipeline.halfway import run_until
from tests.sparse_scenes import as_part, as_solid, block, pad, pocket, run, scan

DEPTH, NOISE = 0.35, 0.02
CASES = [pytest.param(0.15, 0.0, marks=pytest.mark.slow), (0.2, NOISE)]
"""Tolerance and noise."""


@lru_cache
def lost(tolerance: float, noise: float) -> Result:
    return run(scan(block() - pocket(DEPTH), noise), tolerance, adapt="none", allowance="none")


@pytest.mark.parametrize(("tolerance", "noise"), CASES)
def test_a_shallow_loss_holds_little_intact_metal(tolerance: float, noise: float) -> None:
    (site,) = lost(tolerance, noise).sites
    truth = to_manifold(as_solid(block() ^ pocket(DEPTH)))
    excess = (to_manifold(site.damage) - truth).volume()
    assert excess < 0.06 * truth.volume()
    assert site.damage.volume == pytest.approx(truth.volume(), rel=0.06)
    low, high = site.volume_95 or (np.inf, 0.0)
    assert low < truth.volume() < high


@pytest.mark.parametrize(("tolerance", "noise"), CASES)
def test_no_depth_is_beyond_the_deepest_point(tolerance: float, noise: float) -> None:
    (site,) = lost(tolerance, noise).sites
    low, high = site.depth_95 or (np.inf, np.inf)
    assert low < DEPTH <= high + 1e-9
    assert high <= site.max_depth + 2.5 * noise + 0.01


def test_shallow_added_metal_holds_little_that_is_not_there(registry: Registry) -> None:
    points = Scan(scan(block() + pad(DEPTH)))
    found = run_until("fit_model", as_part(block()), points, registry, tolerance=0.15, align="none", adapt="none")
    (item,) = found.state.surplus
    truth = to_manifold(as_solid(pad(DEPTH)))
    assert item.solid is not None
    assert (to_manifold(item.solid) - truth).volume() < 0.08 * truth.volume()
