"""A wall, a pin and a whole body that are gone: found where the scan shows their root, proven where rays passed."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

import damageest
from damageest.artefacts import Part
from damageest.geometry.solids import iou, to_arrays, to_manifold, to_solid
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate

TOLERANCE, NOISE = 0.2, 0.05
VIEWS = [[100, 60, 160], [-120, 80, 140], [20, -140, 140]]
BASE = Manifold.cube((60, 40, 10), True).translate((0, 0, -5))
LOST = {
    "wall of one tolerance": Manifold.cube((40, 0.2, 12), True).translate((0, 0, 6)),
    "wall of two": Manifold.cube((40, 0.4, 12), True).translate((0, 0, 6)),
    "wall of four": Manifold.cube((40, 0.8, 12), True).translate((0, 0, 6)),
    "pin": Manifold.cylinder(15, 1.0, 1.0, 64).translate((10, 5, 0)),
}


def make(body: Manifold) -> Part:
    return Part(*to_arrays(body))


def run(
    whole: Manifold, left: Manifold, known: bool = True, views: list[list[int]] = VIEWS, points: int = 14_000
) -> Result:
    options = {"points": points, "noise": NOISE, "scanners": views, "positions_known": known}
    scan = Simulate.model_validate(options).run("mm", make(left))
    return damageest.run({"version": 1, "tolerance": TOLERANCE, "align": "none"}, part=make(whole), scan=scan)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "points"), [("pin", 14_000), *(pytest.param(name, 50_000, marks=pytest.mark.slow) for name in LOST)]
)
def test_what_broke_off_is_a_proven_site(name: str, points: int) -> None:
    result = run(BASE + LOST[name], BASE, points=points)
    truth = to_solid(LOST[name] - BASE)
    (site,) = result.sites
    # a wall of one tolerance is known to a tenth
    assert site.verdict.level in (("proven", "likely") if "one" in name else ("proven",)), site.verdict
    assert iou(result.damage, truth) > 0.9
    assert site.volume_95 is not None
    assert truth is not None
    assert site.volume_95[0] <= truth.volume <= site.volume_95[1]


@pytest.mark.slow
def test_a_whole_body_that_is_gone_is_a_proven_site() -> None:
    second = Manifold.cube((10, 40, 10), True).translate((45, 0, -5))
    result = run(BASE + second, BASE, views=[*VIEWS, [200, 10, 20]])
    assert [site.verdict.level for site in result.sites] == ["proven"]
    assert iou(result.damage, to_solid(second)) > 0.9


@pytest.mark.slow
def test_without_scanner_positions_a_lost_body_is_unseen_with_its_volume() -> None:
    second = Manifold.cube((10, 40, 10), True).translate((45, 0, -5))
    result = run(BASE + second, BASE, known=False)
    assert not result.sites
    assert result.coverage
    assert any(region.volume == pytest.approx(second.volume(), rel=0.1) for region in result.coverage.unseen)


@pytest.mark.slow
def test_rays_prove_nothing_on_an_undamaged_part() -> None:
    body = BASE + LOST["wall of two"] + LOST["pin"]
    result = run(body, body)
    assert not result.sites
    assert result.coverage
    assert not result.coverage.is_lost.any()
    bottom = result.coverage.skin.triangles[:, :, 2].max(axis=1) < -9.99
    assert result.coverage.is_seen[bottom].mean() < 0.05
    assert to_manifold(result.part).volume() > 0
    assert np.isfinite(result.deviation.distance).all()
