"""Points farther apart than the tolerance: no volume holds metal that the scan does not show as lost, or as added."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Scan
from damageest.geometry.solids import to_manifold
from damageest.registry import Registry
from damageest.result import Result
from tests.pipeline.halfway import run_until
from tests.sparse_scenes import as_part, as_solid, block, pad, pocket, run, scan

DEPTH, NOISE = 0.35, 0.02
CASES = [pytest.param((0.15, 0.0), marks=pytest.mark.slow), (0.2, NOISE)]
"""Tolerance and noise."""


@pytest.fixture(scope="module", params=CASES)
def lost(request: pytest.FixtureRequest) -> tuple[Result, float]:
    """And the noise of the scan."""
    tolerance, noise = request.param
    return run(scan(block() - pocket(DEPTH), noise), tolerance, adapt="none", allowance="none"), noise


@pytest.mark.variants(1)
def test_a_shallow_loss_holds_little_intact_metal(lost: tuple[Result, float]) -> None:
    (site,) = lost[0].sites
    truth = to_manifold(as_solid(block() ^ pocket(DEPTH)))
    excess = (to_manifold(site.damage) - truth).volume()
    assert excess < 0.06 * truth.volume()
    assert site.damage.volume == pytest.approx(truth.volume(), rel=0.06)
    low, high = site.volume_95 or (np.inf, 0.0)
    assert low < truth.volume() < high


def test_no_depth_is_beyond_the_deepest_point(lost: tuple[Result, float]) -> None:
    (site,) = lost[0].sites
    low, high = site.depth_95 or (np.inf, np.inf)
    assert low < DEPTH <= high + 1e-9
    assert high <= site.max_depth + 2.5 * lost[1] + 0.01


@pytest.mark.slow
def test_shallow_added_metal_holds_little_that_is_not_there(registry: Registry) -> None:
    points = Scan(scan(block() + pad(DEPTH)))
    found = run_until("fit_model", as_part(block()), points, registry, tolerance=0.15, align="none", adapt="none")
    (item,) = found.state.surplus
    truth = to_manifold(as_solid(pad(DEPTH)))
    assert item.solid is not None
    assert (to_manifold(item.solid) - truth).volume() < 0.08 * truth.volume()
