"""A tolerance below the noise of the scan is refused with both figures; noise that only seems so large is not."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest
from damageest_benchmarks.parts import PARTS

import damageest
from damageest.artefacts import Deviation, Sites
from damageest.errors import InputError
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.registry import Registry
from damageest.stages.scan.simulate import Simulate
from damageest.trust.scan_quality import require_real_clusters
from tests.pipeline.halfway import run_until


@pytest.mark.slow
@pytest.mark.parametrize("pose", ["known", pytest.param("unknown", marks=pytest.mark.slow)])
def test_noise_of_three_tolerances_is_refused_with_the_tolerance_to_give(pose: str) -> None:
    """Before a pose is looked for: noise as it is measured without one."""
    part = PARTS["lever"]()
    scan = Simulate(points=15_000, noise=0.6, pose="identity" if pose == "known" else "random", seed=3).run("mm", part)
    settings = ["tolerance=0.2"] + ["align=none"] * (pose == "known")
    with pytest.raises(InputError, match=r"0\.2 mm is below the noise of .* 0\.6\d? mm; .* at least 2\.[45] mm.* unit"):
        damageest.run({"version": 1}, part=part, scan=scan, settings=settings)


@pytest.mark.slow
def test_noise_of_less_than_two_tolerances_is_refused_in_the_pose() -> None:
    part = PARTS["lever"]()
    scan = Simulate(points=15_000, noise=0.6, pose="identity", seed=3).run("mm", part)
    with pytest.raises(InputError, match=r"0\.4 mm is below the noise of .* 0\.(59|6|61) mm; .* at least 2\.4 mm"):
        damageest.run({"version": 1}, part=part, scan=scan, settings=["tolerance=0.4", "align=none"])


@pytest.mark.slow
def test_points_too_far_apart_to_show_the_noise_are_not_refused() -> None:
    """On bars a few gaps wide, noise without a pose comes out 400 times too large."""
    part = PARTS["grille"]()
    scan = Simulate(points=1500, noise=0.01, pose="random", seed=1).run("mm", part)
    assert measure_noise_and_spacing(scan.points)[0] > 0.2
    result = damageest.run({"version": 1}, part=part, scan=scan, settings=["tolerance=0.1", "allowance=none"])
    assert not result.sites


@pytest.mark.slow
@pytest.mark.parametrize("pose", ["known", "unknown"])
def test_noise_below_the_tolerance_that_alone_makes_very_many_places_is_refused(pose: str, registry: Registry) -> None:
    part = PARTS["lever"]()
    scan = Simulate(points=40_000, noise=0.2, pose="identity" if pose == "known" else "random", seed=3).run("mm", part)
    align = "none" if pose == "known" else "register"
    with pytest.raises(InputError, match=r"scatter by 0\.(19|2|21) mm: .* places are no deeper .* at least 0\.(7|8)"):
        run_until("find_surplus", part, scan, registry, tolerance=0.25, align=align)


@pytest.mark.parametrize("deeper", [0, 400], ids=["noise alone", "and damage"])
def test_very_many_clusters_are_refused_only_where_noise_makes_them(deeper: int) -> None:
    """Each of five points; ``deeper``: so many of them are below the reach of the noise."""
    tolerance, part = 0.25, PARTS["lever"]()
    distance = np.random.default_rng(0).normal(scale=0.2, size=20_000)
    below = np.flatnonzero(distance < -tolerance)
    label = np.zeros(len(distance), np.int32)
    label[below] = np.arange(len(below)) // 5 + 1
    distance[below[: 5 * deeper]] = -3.0
    sites = Sites(label, int(label.max()))
    deviation = Deviation(distance, np.zeros(len(distance), np.int64), np.zeros(len(distance), np.uint8))
    refused = pytest.raises(
        InputError, match=r"scatter by 0\.(19|2|21) mm: .* places are no deeper .* at least 0\.(7|8)"
    )
    with nullcontext() if deeper else refused:
        require_real_clusters(sites, deviation, tolerance, part)
