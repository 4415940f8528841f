"""The part minus a Poisson body of the whole scan: known damage, slivers, refusals, and the route of a job."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from damageest_open3d.poisson_subtract import PoissonSubtract
from manifold3d import Manifold

import damageest
from damageest.artefacts import Enclosures, Floats, Mesh, Part, Scan, Solid
from damageest.errors import JobError, StageError
from damageest.geometry.solids import iou, to_arrays, to_manifold, to_solid, unite
from damageest.job import load
from damageest.registry import Registry
from damageest.stages.cluster.dbscan import Dbscan
from damageest.stages.enclose import EncloseAll
from damageest.stages.scan.simulate import Simulate
from damageest.stages.segment.mesh_distance import MeshDistance
from tests.needs import needs_plugin

SIZE, NOISE, TOLERANCE, SPACING = np.array([30.0, 20.0, 12.0]), 0.03, 0.15, 0.32
TOOLS: dict[str, Any] = {
    "half ball": lambda: Manifold.sphere(6, 96).translate((0, 0, 6)),
    "end": lambda: Manifold.cube((40, 60, 60), True).rotate((0, 12, 7)).translate((28, 0, 0)),
    "middle": lambda: Manifold.cube((9, 60, 60), True).rotate((0, 15, 0)),
}

pytestmark = needs_plugin("open3d")


def box() -> Part:
    return Part(*to_arrays(Manifold.cube(tuple(SIZE), True)))


@lru_cache
def scan_box(name: str, noise: float = NOISE) -> Floats:
    """Points (N,3), ten for each unit of area, on the box without what one of TOOLS takes."""
    left = Mesh(*to_arrays(Manifold.cube(tuple(SIZE), True) - TOOLS[name]()))
    rng = np.random.default_rng(5)
    area = np.linalg.norm(left.cross, axis=1)
    face = rng.choice(len(area), int(5 * area.sum()), p=area / area.sum())
    u, v = np.sqrt(rng.random((len(face), 1))), rng.random((len(face), 1))
    a, b, c = np.moveaxis(left.triangles[face], 1, 0)
    off = noise * rng.normal(size=(len(face), 1)) * left.cross[face] / area[face, None]
    return np.asarray(a * (1 - u) + b * u * (1 - v) + c * u * v + off)


def inputs(points: Floats) -> dict[str, Any]:
    given: dict[str, Any] = {"part": box(), "aligned": Scan(points, noise=NOISE, spacing=SPACING)}
    given["tolerance"] = TOLERANCE
    given["deviation"] = MeshDistance().run(**given)
    sites = Dbscan().run(given["aligned"], given["deviation"], TOLERANCE)
    return {**given, "sites": sites}


@lru_cache
def enclose(name: str, noise: float = NOISE, depth: int = 7) -> Enclosures:
    return PoissonSubtract(depth=depth).run(**inputs(scan_box(name, noise)))


def intersect(enclosures: Enclosures) -> Any:
    return to_manifold(box()) ^ unite(item.solid for item in enclosures.items)


def read_sliver_note(enclosures: Enclosures) -> tuple[int, int, float]:
    """Slivers, pieces and the slivers' percentage of the volume, as the note has them."""
    notes = " ".join(note for item in enclosures.items for note in item.notes)
    found = re.search(r"(\d+) of the (\d+) pieces .* touch no damaged point: slivers, ([\d.]+)% of the volume", notes)
    assert found, notes
    return int(found[1]), int(found[2]), float(found[3])


@pytest.mark.slow
@pytest.mark.parametrize("name", TOOLS)
def test_the_part_inside_it_is_the_damage_and_slivers(name: str) -> None:
    enclosures = enclose(name)
    truth = to_solid(Manifold.cube(tuple(SIZE), True) ^ TOOLS[name]())
    assert iou(to_solid(intersect(enclosures)), truth) > 0.9
    (item,) = enclosures.items
    assert item.sites == tuple(range(1, inputs(scan_box(name))["sites"].count + 1))
    assert (item.solid.bounds[1] > SIZE / 2 + 1).all()
    assert (item.solid.bounds[0] < -SIZE / 2 - 1).all()


@pytest.mark.slow
def test_the_note_counts_the_slivers_and_all_are_kept() -> None:
    enclosures = enclose("half ball")
    volumes = sorted(body.volume() for body in intersect(enclosures).decompose() if body.volume() > 0)
    count, pieces, percent = read_sliver_note(enclosures)
    assert count > 20
    assert (count, pieces) == (len(volumes) - 1, len(volumes))
    assert percent == pytest.approx(100 * sum(volumes[:-1]) / sum(volumes), abs=0.06)


@pytest.mark.slow
def test_noise_adds_slivers_and_rounded_edges_are_lost_even_without_noise() -> None:
    clean, noisy = (enclose("half ball", noise) for noise in (0.0, NOISE))
    ball = 2 / 3 * np.pi * 6**3
    assert 1.01 * ball < intersect(clean).volume() < intersect(noisy).volume()
    assert read_sliver_note(noisy)[0] > read_sliver_note(clean)[0]
    assert read_sliver_note(noisy)[2] > 2 * read_sliver_note(clean)[2]


@pytest.mark.slow
def test_a_body_in_two_pieces_is_kept_and_noted() -> None:
    (item,) = enclose("middle").items
    assert any("2 closed surfaces" in note for note in item.notes)


@pytest.mark.slow
def test_fewer_levels_give_a_rounder_body() -> None:
    truth = to_solid(Manifold.cube(tuple(SIZE), True) ^ TOOLS["half ball"]())
    coarse, fine = (iou(to_solid(intersect(enclose("half ball", depth=depth))), truth) for depth in (5, 7))
    assert coarse < fine - 0.02


@pytest.mark.slow
def test_a_side_without_points_is_refused() -> None:
    points = scan_box("half ball")
    with pytest.raises(StageError, match="not watertight") as caught:
        PoissonSubtract(depth=7).run(**inputs(points[points[:, 2] > -3]))
    assert "implicit" in caught.value.remedy


@pytest.mark.parametrize("change", ["few", "flat", "one place"])
def test_points_that_enclose_no_body_are_refused(change: str) -> None:
    points = scan_box("half ball")
    given = inputs(points)
    damaged = np.flatnonzero(given["sites"].label)
    chosen = damaged[:60] if change == "few" else damaged[:1000]
    moved = points[chosen] * np.array({"few": (1, 1, 1), "flat": (1, 1, 0), "one place": (0, 0, 0)}[change])
    of = given["deviation"]
    given["deviation"] = type(of)(of.distance[chosen], of.face[chosen], of.label[chosen])
    given["sites"] = type(given["sites"])(given["sites"].label[chosen], given["sites"].count)
    given["aligned"] = Scan(moved, noise=NOISE, spacing=SPACING)
    with pytest.raises(StageError, match="no closed body") as caught:
        PoissonSubtract().run(**given)
    assert caught.value.remedy


def test_naming_it_fixes_the_route() -> None:
    registry = Registry.discover()
    header = {"version": 1, "part": "jobs/parts/gear.step", "scan": {"use": "simulate"}}
    for job in (
        load({**header, "enclose": "poisson_subtract"}, registry),
        load({**header, "method": "implicit", "enclose": {"use": "poisson_subtract", "depth": 8}}, registry),
    ):
        assert (job.method, job.stages[EncloseAll].use) == ("implicit", "poisson_subtract")
    for wrong in ({"method": "surface"}, {"method": "octree"}, {"method": "implicit", "boundary": "all_loops"}):
        with pytest.raises(JobError, match="method: implicit"):
            load({**header, "enclose": "poisson_subtract", **wrong}, registry)


@pytest.mark.slow
def test_a_whole_job_warns_of_what_was_dropped(capfd: pytest.CaptureFixture[str]) -> None:
    tool = {"tool": "sphere", "centre": [0, 0, 6], "radius": 6}
    scan = Simulate.model_validate({"damage": [tool], "points": 20_000, "noise": NOISE}).run("mm", box())
    job = {"version": 1, "tolerance": TOLERANCE, "align": "none", "accept": "all"}
    job["enclose"] = {"use": "poisson_subtract", "depth": 7}
    result = damageest.run(job, part=box(), scan=scan)
    assert result.truth is not None
    assert result.truth[1] > 0.9
    (site,) = result.sites
    assert site.method == "poisson_subtract"
    assert isinstance(site.damage, Solid)
    assert any("slivers" in warning.text for warning in site.warnings)
    assert any("dropped" in warning.text for warning in result.warnings)
    assert capfd.readouterr().out == ""
