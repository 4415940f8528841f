"""What the rays of a scanner at a known position prove: metal that they passed through is gone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.geometry.rays import Crossings, RayCaster, prepare_rays
from damageest.geometry.scan_field import ScanField
from damageest.trust.skin.skin_cells import SkinCells

MOST_RAYS = 100_000
"""Scan points whose rays are followed through the part."""
MOST_WAYS = 20_000
"""Rays of a view that are compared with the directions of unseen cells."""
FEWEST = 3
"""Rays through a cell's neighbourhood that prove a loss; single ones may be stray points."""


@dataclass(frozen=True, eq=False)
class RayEvidence:
    """``lost`` (F,): cells of the skin that rays passed through, with metal behind them; ``roots`` (M,): numbers of the
    scan points that rays reached through such metal, where its loss ends; ``hidden`` and ``outside`` (F,): cells that
    the part itself hides from every scanner position, and cells in no view."""

    lost: Flags
    roots: Ints
    hidden: Flags
    outside: Flags


def trace_rays(field: ScanField, cells: SkinCells, seen: Flags, perhaps_seen: Flags) -> RayEvidence | None:
    """Follows the scanner's rays through the part as designed. None where no scanner position is known.

    Cells that are not ``seen`` (F,) are explained; only those that are not ``perhaps_seen`` (F,) can be proven lost.
    """
    part, aligned, tolerance = field.part, field.aligned, field.tolerance
    if aligned.viewpoints is None or aligned.view is None or not (aligned.view >= 0).any():
        return None
    used = np.flatnonzero(aligned.view >= 0)
    used = used[np.linspace(0, len(used) - 1, min(len(used), MOST_RAYS)).round().astype(np.int64)]
    caster = prepare_rays(part)
    origins, ends = aligned.viewpoints[aligned.view[used]], aligned.points[used]
    hits = caster.find_crossings(origins, ends)
    margin = max(2 * aligned.noise, 0.5 * tolerance)
    way, length = _point_at(ends, origins)
    entry, leave, reached = _find_chords(hits, length, margin)
    ray = hits.ray[entry]
    enter = origins[ray] + hits.distance[entry, None] * way[ray]
    exit_ = origins[ray] + leave[:, None] * way[ray]
    deep = _is_deep(part, caster, enter, exit_, -part.face_normals[hits.face[entry]], tolerance)
    lost = _find_lost(cells, perhaps_seen, np.concatenate([enter[deep], exit_[deep & ~reached]]), aligned.spacing)
    roots = _find_roots(cells, lost, enter, ray, reached & (leave - hits.distance[entry] > margin))
    hidden, outside = _explain_unseen(
        caster, cells, seen, aligned.points, aligned.viewpoints, np.asarray(aligned.view, np.int64), tolerance
    )
    return RayEvidence(lost, np.unique(used[roots]), hidden, outside)


def _find_chords(hits: Crossings, length: Floats, margin: float) -> tuple[Ints, Floats, Flags]:
    """The pieces of rays inside the part: the crossing (C,) that each begins with, the distance (C,) from the scanner
    at which it ends, and whether (C,) it ends at the scan point and not at the skin before it."""
    entry = np.flatnonzero(hits.enters)
    following = np.minimum(entry + 1, max(len(hits.ray) - 1, 0))
    leaves = (following > entry) & (hits.ray[following] == hits.ray[entry]) & ~hits.enters[following]
    end = length[hits.ray[entry]]
    leave = np.where(leaves, hits.distance[following], end) if len(entry) else np.empty(0)
    reached = leave > end - margin
    begins = end - hits.distance[entry] > margin
    return entry[begins], leave[begins], reached[begins]


def _is_deep(part: Part, caster: RayCaster, enter: Floats, leave: Floats, inward: Floats, tolerance: float) -> Flags:
    """Which chords (C,) pass so deep through the part that neither noise nor an error of the pose explains them: by a
    tolerance, or by two fifths of a thin wall."""
    if not len(enter):
        return np.zeros(0, bool)
    depth = distance_to_mesh((enter + leave) / 2, part)
    deep = depth > tolerance
    thin = np.flatnonzero(~deep & (depth > 0.15 * tolerance))
    if len(thin):
        start = enter[thin] + 1e-5 * part.diagonal * inward[thin]
        thickness = caster.find_first(start, inward[thin])[0]
        deep[thin] = depth[thin] > 0.4 * thickness
    return deep


def _find_lost(cells: SkinCells, seen: Flags, places: Floats, spacing: float) -> Flags:
    """Unseen cells (F,) with several places near them at which rays passed through the skin."""
    lost = np.zeros(len(seen), bool)
    bare = np.flatnonzero(~seen)
    if len(places) < FEWEST or not len(bare):
        return lost
    # beyond this distance a place is not found, and its gap is infinite
    gap = find_neighbours(cells.centres[bare], FEWEST, places, 2.5 * spacing + cells.edge)[0]
    lost[bare] = np.isfinite(gap[:, -1])
    return lost


def _find_roots(cells: SkinCells, lost: Flags, enter: Floats, ray: Ints, ends_inside: Flags) -> Ints:
    """The rays (K,) that enter the part through lost skin and end inside it."""
    if not lost.any() or not ends_inside.any():
        return np.empty(0, np.int64)
    chosen = np.flatnonzero(ends_inside)
    nearest = find_neighbours(enter[chosen], 1, cells.centres)[1][:, 0]
    return ray[chosen[lost[nearest]]]


def _explain_unseen(
    caster: RayCaster, cells: SkinCells, seen: Flags, points: Floats, viewpoints: Floats, view: Ints, tolerance: float
) -> tuple[Flags, Flags]:
    """Whether each unseen cell (F,) is hidden from every scanner position, by the part or by what else was scanned, and
    whether it lies in no view."""
    bare = np.flatnonzero(~seen)
    hidden, outside = np.ones(len(bare), bool), np.ones(len(bare), bool)
    places = cells.centres[bare] + 0.1 * tolerance * cells.normals[bare]
    for number, viewpoint in enumerate(viewpoints):
        own = np.flatnonzero(view == number)
        if not len(own) or not len(bare):
            continue
        direction, length = _point_at(places, viewpoint)
        first = caster.find_first(np.broadcast_to(viewpoint, places.shape), direction)[0]
        away = np.einsum("ij,ij->i", direction, cells.normals[bare]) > -0.05
        ways, reached = _point_at(points[own[:: max(1, len(own) // MOST_WAYS)]], viewpoint)
        apart = float(np.median(find_neighbours(ways[:2000], 2, ways)[0][:, -1]))
        _, index = find_neighbours(direction, 1, ways, 3 * apart)
        # where the nearest ray ended before the cell, a body that is not the part hides it
        stopped = np.append(reached, np.inf)[index[:, 0]] < length - 2 * tolerance
        hidden &= away | (first < length - 0.2 * tolerance) | stopped
        axis = ways.mean(axis=0) / max(float(np.linalg.norm(ways.mean(axis=0))), 1e-300)
        outside &= direction @ axis < float((ways @ axis).min()) - 1e-3
    whole = np.zeros((2, len(seen)), bool)
    whole[:, bare] = hidden, outside
    return whole[0], whole[1]


def _point_at(places: Floats, origin: Floats) -> tuple[Floats, Floats]:
    """Unit directions (N,3) from one origin (3,) or from several (N,3) to places (N,3), and their distances (N,)."""
    way = places - origin
    length = np.linalg.norm(way, axis=1)
    return way / np.maximum(length, 1e-300)[:, None], length
