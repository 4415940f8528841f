"""The octree difference of part and scan: on damage of known truth, and at the limits of its cells."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import igl
import numpy as np
import pytest
from damageest_octree import octree
from damageest_octree.octree import Octree

import damageest
from damageest.artefacts import INTACT, Enclosures, Part, Sites, Solid
from damageest.errors import StageError
from damageest.geometry.solids import iou, to_manifold, to_solid, unite
from tests import damaged_box
from tests.scenes import Scene, scene

CELL = 0.32
"""The spacing of the scenes' points, and so the default cell."""


@lru_cache
def enclose(name: str, **options: Any) -> Enclosures:
    return Octree(**options).run(**scene(name).inputs())


def intersect(case: Scene, enclosures: Enclosures) -> Solid:
    damage = to_solid(to_manifold(case.part) ^ unite(item.solid for item in enclosures.items))
    assert damage is not None
    return damage


def read_advice(error: StageError, option: str) -> float:
    found = re.search(rf"enclose\.{option}: (\d+(\.\d+)?)", error.remedy)
    assert found, error.remedy
    return float(found[1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "least"),
    [("pit", 0.92), ("worn through", 0.89),
     *(pytest.param(*one, marks=pytest.mark.slow) for one in (
         ("edge", 0.94), ("end", 0.99), ("two", 0.83), ("deep hole", 0.82), ("beside the bore", 0.92)))],
)  # fmt: skip
def test_the_part_inside_it_is_the_damage(name: str, least: float) -> None:
    case = scene(name)
    damage = intersect(case, enclose(name))
    assert iou(damage, case.truth) > least
    intact = case.aligned.points[(case.deviation.label == INTACT) & (case.sites.label == 0)]
    depth = -np.ravel(igl.signed_distance(np.array(intact), np.array(damage.vertices), np.array(damage.faces))[0])
    assert (depth > CELL).sum() <= 1e-3 * len(intact)


@pytest.mark.slow
def test_every_site_is_in_an_enclosure_and_enclosures_are_disjoint() -> None:
    case, enclosures = scene("two"), enclose("two")
    assert sorted(k for item in enclosures.items for k in item.sites) == list(range(1, case.sites.count + 1))
    first, second = (to_manifold(item.solid) for item in enclosures.items)
    assert (first ^ second).volume() == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
def test_the_void_outside_the_part_is_only_taken_near_the_loss() -> None:
    (item,), truth = enclose("pit").items, scene("pit").truth
    assert np.abs(item.solid.bounds - truth.bounds).max() < 6 * CELL


@pytest.mark.slow
@pytest.mark.parametrize(("points", "off"), [(10_000, 0.16), pytest.param(20_000, 0.08, marks=pytest.mark.slow)])
def test_the_route_gives_the_lost_half_ball(points: int, off: float, tmp_path: Path) -> None:
    result = damageest.run(damaged_box.write(tmp_path, damaged_box.JOB + "method: octree\n", points))
    (site,) = result.sites
    assert site.damage.volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=off)
    assert site.evidence.consistent


@pytest.mark.slow
def test_coarser_cells_give_a_coarser_volume() -> None:
    case = scene("end")
    fine, middle, coarse = (iou(intersect(case, enclose("end", cell=cell)), case.truth) for cell in (0.6, 1.0, 1.6))
    assert fine > middle > coarse > 0.9


@pytest.mark.slow
def test_depth_sets_the_cell_too() -> None:
    by_depth, by_cell = enclose("pit", depth=6), enclose("pit", cell=30 / (2**6 - 16))
    assert by_depth.items[0].solid.vertices.tobytes() == by_cell.items[0].solid.vertices.tobytes()
    assert by_depth.items[0].solid.vertices.tobytes() != enclose("pit").items[0].solid.vertices.tobytes()
    with pytest.raises(ValueError, match="give one of them"):
        Octree(depth=6, cell=1)


@pytest.mark.slow
def test_cells_that_do_not_fit_into_memory_are_refused_and_those_that_fit_are_named() -> None:
    inputs = scene("pit").inputs()
    with pytest.raises(StageError, match=r"need .* GiB; enclose.memory is 0\.02") as caught:
        Octree(cell=0.3, memory=0.02).run(**inputs)
    cell, depth = read_advice(caught.value, "cell"), int(read_advice(caught.value, "depth"))
    assert cell > 0.4
    assert Octree(cell=cell, memory=0.02).run(**inputs).items
    assert Octree(depth=depth, memory=0.02).run(**inputs).items


@pytest.mark.slow
def test_the_default_cell_grows_to_fit_into_memory_and_a_note_says_so() -> None:
    case = scene("end")
    enclosures = Octree(memory=0.02).run(**case.inputs())
    assert "instead of 0.32" in enclosures.items[0].notes[0]
    assert iou(intersect(case, enclosures), case.truth) > 0.95


@pytest.mark.slow
def test_a_grid_round_a_loss_that_does_not_fit_into_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    inputs = scene("end").inputs()
    monkeypatch.setattr(octree, "BYTES_PER_CELL", 20_000)
    with pytest.raises(StageError, match=r"the grid round a loss needs .* enclose.memory is 2") as caught:
        Octree().run(**inputs)
    assert Octree(cell=read_advice(caught.value, "cell")).run(**inputs).items


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{"depth": 12}, *(pytest.param({"cell": cell}, marks=pytest.mark.slow) for cell in (0.05, 0.13))]
)
def test_cells_finer_than_the_scan_are_refused(options: dict[str, Any]) -> None:
    case = scene("pit")
    with pytest.raises(StageError, match=r"points 0\.32 apart") as caught:
        Octree(**options).run(**case.inputs())
    again = Octree(cell=read_advice(caught.value, "cell")).run(**case.inputs())
    assert iou(intersect(case, again), case.truth) > 0.9


def test_damage_shallower_than_the_cells_is_refused() -> None:
    with pytest.raises(StageError, match="as deep as a cell") as caught:
        Octree(cell=3).run(**scene("pit").inputs())
    assert "method: implicit" in caught.value.remedy


@pytest.mark.slow
def test_skin_that_the_scanner_did_not_see_is_not_lost() -> None:
    case = scene("pit")
    partial = case.without(np.linalg.norm(case.aligned.points - [26, 3, 12], axis=1) < 3)
    enclosures = Octree().run(**partial.inputs())
    assert iou(intersect(partial, enclosures), case.truth) > 0.92
    assert any("has no scan points" in note for note in enclosures.items[0].notes)
    assert enclose("pit").items[0].notes == (
        "gaps between the scan points were closed up to 2 cells of 0.32; a denser scan needs less",
    )


@pytest.mark.slow
def test_the_same_input_gives_the_same_bytes() -> None:
    first, again = enclose("pit"), Octree().run(**scene("pit").inputs())
    for one, other in zip(first.items, again.items, strict=True):
        assert one.solid.vertices.tobytes() == other.solid.vertices.tobytes()
        assert one.solid.faces.tobytes() == other.solid.faces.tobytes()
        assert (one.sites, one.notes) == (other.sites, other.notes)


@pytest.mark.slow
def test_far_from_the_origin_the_damage_is_the_same() -> None:
    case, shift = scene("pit"), np.array([3e5, -2e5, 1e5])
    moved = {
        **case.inputs(),
        "part": Part(case.part.vertices + shift, case.part.faces),
        "aligned": replace(case.aligned, points=case.aligned.points + shift),
    }
    solid = Octree().run(**moved).items[0].solid
    back = Solid(solid.vertices - shift, solid.faces)
    assert iou(back, enclose("pit").items[0].solid) > 0.995


def test_no_site_no_enclosure() -> None:
    case = scene("pit")
    none = Sites(np.zeros(len(case.aligned.points), np.int32), 0)
    assert Octree().run(**{**case.inputs(), "sites": none}).items == ()
