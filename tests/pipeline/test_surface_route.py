"""Site by site, end to end: several rims, losses that several surfaces bound, any background that is valid."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS
from damageest_evaluate.scores import iou

import damageest
from damageest.artefacts import Part, Scan, Solid, Truth
from damageest.errors import StageError
from damageest.geometry.solids import to_arrays
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate
from tests.pipeline.halfway import Halfway, run_until

SMOOTH = ["minkowski", "offset", "capsule", "cylinder", "bbox", "build_volume"]


def ring() -> Part:
    from manifold3d import CrossSection, Manifold

    return Part(*to_arrays(Manifold.revolve(CrossSection.circle(8, 64).translate((30, 0)), 120)))


def scanned(
    part: Part, *tools: dict[str, Any], points: int = 60_000, noise: float = 0.0005
) -> tuple[Part, Scan, float]:
    """A part, its scan, and the tolerance for it. ``noise``: in diagonals of the part."""
    sigma = noise * part.diagonal
    scan = Simulate.model_validate({"damage": tools, "points": points, "noise": sigma, "seed": 3}).run("mm", part)
    return part, scan, 4 * sigma


def truth(scan: Scan) -> Solid:
    assert isinstance(scan.truth, Truth)
    assert scan.truth.damage is not None
    return scan.truth.damage


def run(scene: tuple[Part, Scan, float], **stages: Any) -> Result:
    part, scan, tolerance = scene
    job = {"version": 1, "method": "surface", "align": "none", "tolerance": tolerance, **stages}
    return damageest.run(job, part=part, scan=Scan(scan.points))


def right(result: Result, scan: Scan, least: float = 0.98) -> bool:
    agrees = all(site.evidence.consistent and site.method == "surface" for site in result.sites)
    return agrees and result.status == "ok" and iou([site.damage for site in result.sites], [truth(scan)]) > least


@pytest.fixture(scope="module")
def bar() -> tuple[Part, Scan, float]:
    return scanned(PARTS["cylinder"](), {"tool": "sphere", "centre": [20, 0, 0], "radius": 9}, points=9000, noise=0.001)


@pytest.fixture(scope="module")
def acquired(bar: tuple[Part, Scan, float], registry: Registry) -> Halfway:
    """Before anything is enclosed."""
    part, scan, tolerance = bar
    job = {"method": "surface", "align": "none", "tolerance": tolerance}
    return run_until("take_clusters", part, Scan(scan.points), registry, **job)


@pytest.fixture(scope="module")
def first(acquired: Halfway) -> Result:
    return acquired.finish(background="minkowski")


def test_the_damage_is_right(bar: tuple[Part, Scan, float], first: Result) -> None:
    assert right(first, bar[1])


@pytest.mark.parametrize("enclose", ["adaptive", pytest.param("shortest_path", marks=pytest.mark.slow)])
@pytest.mark.parametrize("background", [n if n == "bbox" else pytest.param(n, marks=pytest.mark.slow) for n in SMOOTH])
def test_the_background_does_not_matter_where_it_is_valid(
    bar: tuple[Part, Scan, float], acquired: Halfway, first: Result, background: str, enclose: str
) -> None:
    chosen: dict[str, Any] = {"use": background}
    if background == "build_volume":
        chosen["size"] = [200, 200, 200]
    result = acquired.finish(background=chosen, enclose=enclose)
    assert right(result, bar[1])
    assert iou([result.sites[0].damage], [first.sites[0].damage]) > 0.99


@pytest.mark.parametrize(
    "background", [pytest.param(n, marks=pytest.mark.slow) for n in ("bbox", "cylinder", "capsule")]
)
def test_where_it_is_not_valid_it_says_so(background: str) -> None:
    """Shortest ways from the rims in a worn-through wall run through it; the default divides the part."""
    tool = {"tool": "cylinder", "point": [0, 0, 0], "axis": [1, 0, 0], "length": 50, "radius": 6}
    scene = scanned(PARTS["tube"](), tool)
    with pytest.raises(StageError, match="runs through the part"):
        run(scene, background=background, enclose="adaptive")
    assert right(run(scene, background=background), scene[1])


@pytest.mark.slow
def test_a_groove_round_a_shaft(tmp_path: Path) -> None:
    trimesh.creation.annulus(14, 30, 10, sections=128).export(tmp_path / "groove.stl")
    scene = scanned(PARTS["cylinder"](), {"tool": "mesh", "path": str(tmp_path / "groove.stl")})
    result = run(scene, boundary="all_loops")
    assert right(result, scene[1])
    assert len(result.sites) == 1


@pytest.mark.slow
def test_a_piece_broken_out_of_a_ring() -> None:
    """Two damage surfaces, neither of which separates anything alone."""
    scene = scanned(ring(), {"tool": "box", "centre": [30, 0, 0], "size": [30, 25, 30]})
    for background in ("minkowski", {"use": "build_volume", "size": [120, 120, 60]}):
        result = run(scene, boundary="all_loops", background=background)
        assert right(result, scene[1])
        assert result.sites[0].clusters == (1, 2)


@pytest.mark.slow
def test_two_pieces_broken_out_of_a_frame_and_a_dent_beside() -> None:
    """Of five damage surfaces four bound two losses in pairs, and one bounds its own."""
    from manifold3d import Manifold

    frame = Manifold.cube((90, 60, 10), True)
    for side in (-20, 20):
        frame -= Manifold.cube((30, 40, 20), True).translate((side, 0, 0))
    scene = scanned(
        Part(*to_arrays(frame)),
        {"tool": "box", "centre": [0, 0, 0], "size": [16, 12, 30], "rotation": [10, 5, 0]},
        {"tool": "box", "centre": [-42, 2, 0], "size": [20, 14, 30]},
        {"tool": "sphere", "centre": [20, 28, 5], "radius": 5},
    )
    result = run(scene)
    assert right(result, scene[1])
    assert sorted(len(site.clusters) for site in result.sites) == [1, 2, 2]


@pytest.mark.slow
def test_one_end_of_a_missing_piece_unseen_is_refused_and_named() -> None:
    part, scan, tolerance = scanned(
        ring(), {"tool": "box", "centre": [30, 0, 0], "size": [30, 25, 30]}, points=6000, noise=0.001
    )
    seen = scan.points[~((np.abs(scan.points[:, 1] - 12.5) < 3) & (scan.points[:, 0] > 0))]
    with pytest.raises(StageError, match=r"enclose: divide \(\d+ points near \("):
        run((part, Scan(seen), tolerance))
