"""What matter outside the nominal surface is: added metal on the part, a piece of it displaced, or something else that
was scanned with it, as a table, a fixture or a second specimen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from damageest.artefacts import Floats, Ints, Part, Sites, Solid
from damageest.findings import Surplus
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours, pick_one_per_cube
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.threads import count_threads
from damageest.geometry.voxels import measure_area, measure_bounds
from damageest.trust.beyond_points import measure_beyond_points

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

FAR, FAR_SHARE = 0.15, 0.25
"""Distance from the skin, as a share of the part's diagonal, that added metal hardly has; the share of a cluster's
points beyond it from which the cluster is not on the part."""
FLAT_SHARE = 0.9
"""Share of a cluster's points that are within two tolerances of one plane, where it is a plane."""
ALIKE, AREA_ALIKE = 2.0, 3.0
"""Largest ratio of the volumes, and of the areas of skin, of a displaced piece and of the loss beside it."""
NEAR = 10.0
"""Distance in tolerances up to which a loss is beside a surplus."""
UNSEEN = 0.1
"""Share of a solid's surface without scan points from which a note says so."""
OPEN = 0.5
"""The same share from which the volume is not known."""
DISPLACED = "it may be a displaced piece of the part"
MOST = 20_000
"""Points of a cluster looked at."""


@dataclass(frozen=True, eq=False)
class _Patch:
    """A cluster of deviating points, thinned: ``points`` (M,3), their ``feet`` (M,3), which are the nearest places on
    the skin, and the ``mean`` distance between both. The ``area`` of the points and that of their feet, ``covered``,
    are those of the cubes of a grid that they touch."""

    points: Floats
    feet: Floats
    area: float
    covered: float
    mean: float

    @cached_property
    def tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    @cached_property
    def feet_tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self.feet)

    @cached_property
    def bounds(self) -> Floats:
        return measure_bounds(self.points)


def describe_surplus(clusters: Sites, losses: Sites, field: ScanField) -> tuple[Surplus, ...]:
    """The surplus that each of the ``clusters`` of points outside the skin is, in their order, without solids.

    ``losses``: the clusters of damaged points.
    """
    cell = max(field.tolerance, 1.5 * field.aligned.spacing)
    found: list[Surplus] = []
    if not clusters.count:
        return ()
    patches = {k: _measure_patch(field, losses.members(k), cell) for k in range(1, losses.count + 1)}
    for number in range(1, clusters.count + 1):
        members = clusters.members(number)
        patch = _measure_patch(field, members, cell)
        surplus = Surplus(
            id=number,
            points=members,
            share=len(members) / len(field.points),
            solid=None,
            height=float(field.distance[members].max()),
            area=patch.covered,
            estimate=patch.covered * patch.mean,
        )
        found.append(_name_kind(surplus, patch, patches, field))
    return tuple(found)


def compare_with_losses(surplus: Surplus, volumes: Sequence[float]) -> Surplus:
    """The surplus, which is no displaced piece where the ``volumes`` of the losses beside it differ from its own."""
    if surplus.kind != "displaced piece" or surplus.volume is None or not volumes:
        return surplus
    if any(1 / ALIKE <= volume / surplus.volume <= ALIKE for volume in (*volumes, sum(volumes))):
        return surplus
    return replace(surplus, kind="surplus", notes=tuple(n for n in surplus.notes if not n.startswith(DISPLACED)))


def join_surplus(items: Sequence[Surplus]) -> Surplus:
    """Several clusters that bound one volume, as one surplus without solid."""
    kinds = {item.kind for item in items}
    return Surplus(
        id=items[0].id,
        points=np.unique(np.concatenate([item.points for item in items])),
        share=sum(item.share for item in items),
        solid=None,
        height=max(item.height for item in items),
        area=sum(item.area for item in items),
        kind="displaced piece" if "displaced piece" in kinds else "surplus",
        clusters=tuple(sorted({cluster for item in items for cluster in item.clusters})),
        notes=tuple(dict.fromkeys(note for item in items for note in item.notes)),
        estimate=sum(item.estimate for item in items),
    )


def close_surplus(surplus: Surplus, solid: Solid, field: ScanField, unit: str) -> Surplus | None:
    """The surplus with its volume and the skin that it covers; None where its points are not on the solid's surface.

    A note says so where much of the solid's surface has no scan points. Without a solid where the solid holds more than
    its points show; a note says how much.
    """
    aligned, tolerance, points = field.aligned, field.tolerance, field.points[surplus.points]
    beyond = measure_beyond_points(solid, field, points, unit)
    if beyond.is_contradicted:
        return replace(surplus, notes=(*surplus.notes, f"its volume is not known: {beyond.reason}"))
    points = points[:: max(1, len(points) // 5000)]
    if float(np.quantile(distance_to_mesh(points, solid), 0.95)) > 3 * tolerance + aligned.spacing:
        return None
    outer = find_inner_faces(solid, field.part)
    area = solid.face_areas
    notes = (*surplus.notes, *([beyond.reason] if beyond.reason else []))
    if outer.any():
        places = sample_by_area(solid, 4000, np.random.default_rng(0), np.flatnonzero(outer))[0]
        far = max(3 * tolerance, 2 * aligned.spacing)
        gap = find_neighbours(places, 1, aligned.points[find_nearby(aligned.points, places, far)], far)[0]
        unseen = float(np.isinf(gap).mean())
        if unseen > OPEN:
            note = f"its volume is not known: {unseen:.0%} of its surface has no scan point nearby"
            return replace(surplus, notes=(*surplus.notes, note))
        if unseen > UNSEEN:
            notes = (*notes, f"{unseen:.0%} of its surface has no scan point nearby: its volume is interpolated there")
    on_skin = float(area[~outer].sum())
    return replace(surplus, solid=solid, area=on_skin or surplus.area, notes=notes)


def _name_kind(surplus: Surplus, patch: _Patch, losses: dict[int, _Patch], field: ScanField) -> Surplus:
    part, tolerance = field.part, field.tolerance
    far = max(NEAR * tolerance, FAR * part.diagonal)
    beyond = float((field.distance[surplus.points] > far).mean())
    is_flat = _is_plane(patch.points, tolerance)
    if beyond > FAR_SHARE or (is_flat and patch.covered < 0.35 * patch.area):
        what = "it may be a fixture, a table or another object"
        if is_flat:
            what = "it is a plane, like a table"
        elif _resembles(patch, part):
            what = "it has the size and the area of the part, and may be a second specimen of it"
        return replace(surplus, kind="surroundings", notes=(what,), estimate=0.0)
    spacing = field.aligned.spacing
    beside = {number: loss for number, loss in losses.items() if _is_beside(patch, loss, tolerance, spacing)}
    surplus = replace(surplus, clusters=tuple(beside))
    like: list[tuple[int, ...]] = [(number,) for number, loss in losses.items() if _is_alike(patch, [loss])]
    like = [one for one in like if one[0] in beside or _is_opposite(patch, losses[one[0]])]
    if not like and len(beside) > 1 and _is_alike(patch, list(beside.values())):
        like = [tuple(beside)]
    if not like:
        return surplus
    best = min(like, key=lambda one: abs(np.log(sum(losses[k].covered for k in one) / patch.covered)))
    area, mean = sum(losses[k].covered for k in best), _average_mean([losses[k] for k in best])
    note = (
        f"{DISPLACED}: it covers {patch.covered:.4g} in area and is {patch.mean:.3g} high "
        f"on average, and beside it {area:.4g} in area is lost, {mean:.3g} deep on average"
    )
    clusters = tuple(sorted({*surplus.clusters, *best}))
    return replace(surplus, kind="displaced piece", clusters=clusters, notes=(note,))


def _measure_patch(field: ScanField, members: Ints, cell: float) -> _Patch:
    points = field.points[members]
    fine, kept = cell / 2, points[pick_one_per_cube(points, cell / 2)]
    while len(kept) > MOST:
        fine *= 1.5
        kept = kept[pick_one_per_cube(kept, fine)]
    points, cell = kept, 2 * fine
    distance, _, feet = closest_on_mesh(points, field.part)
    return _Patch(points, feet, measure_area(points, cell), measure_area(feet, cell), float(distance.mean()))


def _is_plane(points: Floats, tolerance: float) -> bool:
    """Whether nearly all points lie on one plane that is much wider than the tolerance."""
    centred = points - points.mean(axis=0)
    _, spread, axes = np.linalg.svd(centred[:: max(1, len(centred) // 5000)], full_matrices=False)
    if len(spread) < 3 or spread[1] < 10 * spread[2]:
        return False
    height = centred @ axes[2]
    height -= np.median(height)
    return float((np.abs(height) < 2 * tolerance).mean()) > FLAT_SHARE and float(np.ptp(centred @ axes[1])) > (
        20 * tolerance
    )


def _resembles(patch: _Patch, part: Part) -> bool:
    """Whether a cluster has the extents of the part, and a part of its area that a scan can show."""
    skin = sample_by_area(part, 5000, np.random.default_rng(0))[0]
    own, whole = _measure_extents(patch.points), _measure_extents(skin)
    return bool((own > 0.7 * whole).all() and (own < 1.3 * whole).all() and 0.3 < patch.area / part.area < 1.6)


def _measure_extents(points: Floats) -> Floats:
    """(3,) extents of the points along their principal axes."""
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred[:: max(1, len(centred) // 5000)], full_matrices=False)
    return np.asarray(np.ptp(centred @ axes.T, axis=0))


def _is_beside(patch: _Patch, loss: _Patch, tolerance: float, spacing: float) -> bool:
    reach = max(NEAR * tolerance, 3 * spacing)
    if _measure_box_gap(loss.bounds, patch.bounds).max() > reach:  # no point of one is nearer to the other
        return False
    gap = np.asarray(patch.tree.query(loss.points, workers=count_threads())[0])
    return bool(gap.min() <= reach)


def _measure_box_gap(first: Floats, second: Floats) -> Floats:
    """(3,) how far two boxes (2,3) lie apart along each axis."""
    return np.asarray(np.maximum(np.maximum(first[0] - second[1], second[0] - first[1]), 0.0))


def _is_opposite(patch: _Patch, loss: _Patch) -> bool:
    """Whether a loss lies over against the surplus, on the other side of a wall."""
    near = 0.5 * np.sqrt(patch.covered)
    low, high = measure_bounds(patch.feet)
    beyond = np.linalg.norm(np.maximum(np.maximum(low - loss.feet, loss.feet - high), 0.0), axis=1)
    if np.median(beyond) > near:  # each is at least as far from the feet as from the box around them
        return False
    return bool(np.median(patch.feet_tree.query(loss.feet, workers=count_threads())[0]) <= near)


def _is_alike(patch: _Patch, losses: Sequence[_Patch]) -> bool:
    area = sum(loss.covered for loss in losses) / patch.covered
    volume = area * _average_mean(losses) / patch.mean
    return 1 / AREA_ALIKE <= area <= AREA_ALIKE and 1 / ALIKE <= volume <= ALIKE


def _average_mean(losses: Sequence[_Patch]) -> float:
    return sum(loss.mean * loss.covered for loss in losses) / sum(loss.covered for loss in losses)
