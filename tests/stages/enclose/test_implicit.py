"""The implicit enclosure, intersected with the part, is the damage, for damage of all kinds."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from damageest.artefacts import Enclosures, Sites
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.solids import iou, to_manifold, to_solid, unite
from damageest.pipeline.near_damage import sample_near_damage
from damageest.stages.enclose._loss_surface import build_surface
from damageest.stages.enclose.implicit import Implicit
from damageest.stages.sample.edge_aware import EdgeAware
from tests.scenes import TOLERANCE, Scene, scene


def enclose_with(case: Scene, stage: Implicit | None = None, **changed: Any) -> Enclosures:
    return (stage or Implicit()).run(**{**case.inputs(), "nearby": case.nearby, **changed})


@lru_cache
def enclose(name: str) -> Enclosures:
    return enclose_with(scene(name))


def intersect_pieces(case: Scene, enclosures: Enclosures) -> list[object]:
    bodies = (to_solid(to_manifold(case.part) ^ to_manifold(item.solid)) for item in enclosures.items)
    return [body for body in bodies if body is not None]


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("pit", 0.97),
        pytest.param("edge", 0.97, marks=pytest.mark.slow),
        ("deep hole", 0.95),
        pytest.param("end", 0.985, marks=pytest.mark.slow),
        pytest.param("beside the bore", 0.96, marks=pytest.mark.slow),
        ("worn through", 0.95),
        ("two", 0.95),
    ],
)
def test_the_part_inside_it_is_the_damage(name: str, least: float) -> None:
    case = scene(name)
    pieces = intersect_pieces(case, enclose(name))
    assert iou(to_solid(unite(pieces)), case.truth) > least


def test_every_site_is_in_an_enclosure_and_none_in_two() -> None:
    case = scene("two")
    enclosures = enclose("two")
    assert sorted(k for item in enclosures.items for k in item.sites) == list(range(1, case.sites.count + 1))
    first, second = (to_manifold(body) for body in intersect_pieces(case, enclosures))
    assert (first ^ second).volume() == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
def test_a_site_of_two_places_is_in_one_enclosure() -> None:
    """Stage cluster may link points over a wider gap than the enclosure does; it was in two, which is not valid."""
    case = scene("two")
    sites = Sites(np.minimum(case.sites.label, 1).astype(np.int32), 1)
    enclosures = enclose_with(case, sites=sites)
    assert [item.sites for item in enclosures.items] == [(1,)]
    assert iou(to_solid(unite(intersect_pieces(case, enclosures))), case.truth) > 0.9


@pytest.mark.slow
def test_skin_that_the_scanner_did_not_see_is_not_lost() -> None:
    case = scene("pit")
    away = np.linalg.norm(case.aligned.points - [26, 3, 12], axis=1) < 3
    assert away.sum() > 100
    partial = case.without(away)
    pieces = intersect_pieces(partial, enclose_with(partial))
    assert iou(to_solid(unite(pieces)), case.truth) > 0.97


@pytest.mark.slow
def test_the_same_input_gives_the_same_bytes() -> None:
    first, again = enclose("pit").items[0], enclose_with(scene("pit")).items[0]
    assert first.solid.vertices.tobytes() == again.solid.vertices.tobytes()
    assert first.solid.faces.tobytes() == again.solid.faces.tobytes()


@pytest.mark.slow
def test_a_loss_too_large_for_its_grid_is_solved_coarsely_and_a_note_says_so() -> None:
    case = scene("end")
    (item,) = enclose_with(case, Implicit(most_cells=60_000)).items
    assert "cells of" in item.notes[0]
    (piece,) = (to_solid(body) for body in (to_manifold(case.part) ^ to_manifold(item.solid)).decompose()[:1])
    assert iou(piece, case.truth) > 0.9


@pytest.mark.slow
def test_detail_spares_triangles_and_moves_the_surface_by_no_more() -> None:
    case = scene("pit")
    fine, coarse = (enclose_with(case, Implicit(detail=detail)).items[0].solid for detail in (0.0, 0.1))
    assert len(coarse.faces) < 0.5 * len(fine.faces)
    assert distance_to_mesh(coarse.vertices, fine).max() < 0.1 * TOLERANCE
    gone = distance_to_mesh(fine.vertices, coarse)
    assert np.quantile(gone, 0.99) < 0.1 * TOLERANCE
    assert gone.max() < 0.25 * TOLERANCE


def test_no_site_no_enclosure() -> None:
    case = scene("pit")
    none = Sites(np.zeros(len(case.aligned.points), np.int32), 0)
    assert enclose_with(case, sites=none).items == ()


def test_the_void_outside_the_part_is_only_taken_near_the_loss() -> None:
    case = scene("pit")
    (item,) = enclose("pit").items
    reach = 25 * TOLERANCE
    assert (item.solid.bounds[0] > case.truth.bounds[0] - reach).all()
    assert (item.solid.bounds[1] < case.truth.bounds[1] + reach).all()


@pytest.mark.slow
def test_more_points_give_a_better_surface_where_it_is_curved() -> None:
    """Points are left out where they show that the surface is flat. Curvature below the noise of a single point shows
    in a dense scan."""
    case = scene("rough")
    errors = []
    for seen in (case, case.without(np.arange(len(case.aligned.points)) % 12 > 0)):
        (piece,) = intersect_pieces(seen, enclose_with(seen))
        differs = to_manifold(case.truth) - to_manifold(piece), to_manifold(piece) - to_manifold(case.truth)
        errors.append(sum(body.volume() for body in differs) / (case.truth.area / 2) / TOLERANCE)
    assert errors[0] < 0.08
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.slow
def test_skin_samples_reach_as_far_as_the_grid_does() -> None:
    case, wide = scene("edge"), Implicit(margin=60)
    nearby = sample_near_damage(case.field, case.sites, wide)
    skin = EdgeAware().run(part=case.part, tolerance=10 * TOLERANCE).points
    reached = KDTree(case.of_sites()).query(skin)[0] < 60 * TOLERANCE
    assert KDTree(nearby.points).query(skin[reached])[0].max() < nearby.spacing
    assert len(case.nearby.points) < 0.9 * len(nearby.points), "the default margin needs fewer"
    (item,) = enclose_with(case, wide, nearby=nearby).items
    (piece,) = intersect_pieces(case, Enclosures((item,)))
    assert iou(piece, case.truth) > 0.97


def test_shallow_points_apart_from_the_rest_open_to_the_skin_above_them() -> None:
    """In a worn bore, few points at the rim of the wear exceed the tolerance. The scan is too sparse to show the
    skin above them bare, and the skin lost on the other side of the bore must not turn them."""
    angle, along = (grid.ravel() for grid in np.meshgrid(np.linspace(-0.1, 0.1, 15), np.linspace(-1, 1, 15)))
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = 10.2 * out + along[:, None] * np.array([0, 0, 1.0])
    far, height = (grid.ravel() for grid in np.meshgrid(np.linspace(2, 4.3, 40), np.linspace(-9, 9, 30)))
    other = np.stack([np.cos(far), np.sin(far), 0 * far], axis=1)
    lost = 10 * other + height[:, None] * np.array([0, 0, 1.0])
    _, normals, _ = build_surface(points, -out, np.full(len(points), 0.2), lost, -other, 0.005, 0.8 * 0.2)
    assert (normals[:, 0] < -0.9).all()
