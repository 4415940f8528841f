"""On which side of the damaged points the metal is gone, by what the scan shows of the intact skin at their rim."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import INTACT, Flags, Floats, Part
from damageest.geometry.local_fits import smooth_points
from damageest.geometry.neighbourhoods import find_neighbours, pick_at_most, pick_one_per_cube
from damageest.geometry.orientation import find_signs
from damageest.geometry.rays import prepare_rays
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin_near import NearCubes
from damageest.geometry.vectors import normalise
from damageest.stages.enclose._skin import DamagedPoints, SkinSamples

RIM = 4.0
"""How far from the damaged points intact ones show the side, in point spacings or tolerances."""
THIN = 4.0
"""Thickest wall that is thin, in point spacings."""
BELOW = 0.5
"""Sine of the angle below the damaged surface from which skin lies behind it, and of that by which it faces away."""
STRAIGHT = 0.8
"""Sine from which skin lies straight below the damaged surface and faces straight away from it, in a wall of any
thickness."""
AROUND = 12
"""Damaged points whose normals together tell the outward side above the flanks of a groove."""
FIT_COUNT = 24
LEAST_SHARE = 0.1
"""Share of the skin beside a site that no point shows, which has to be behind for any to be."""
MOST = 20_000
"""Damaged points, at most, whose normals tell the side: more of them say the same, and take seconds."""
FEWEST = 8
"""Intact points at the rim, at least, for them to show the side."""


def find_behind(field: ScanField, damaged: DamagedPoints, skin: SkinSamples) -> Flags:
    """Which samples (S,) of the ``skin`` that no point shows lie behind the damaged points: the far skin of a thin
    wall, on the side where metal is left.

    An inner surface hangs on the intact skin at its rim, whose outward side is that of the part. It is carried from
    the intact points to the damaged ones along the scan. None is behind where the scan shows too little of the rim.
    """
    part, aligned, cell = field.part, field.aligned, field.tolerance  # nothing is resolved below the tolerance
    behind = np.zeros(len(skin.points), bool)
    asked = np.flatnonzero(skin.bare & np.isfinite(skin.away))
    intact = np.flatnonzero((field.label == INTACT) & ~damaged.grown)
    if not len(damaged.points) or not len(asked) or not len(intact):
        return behind
    reach = RIM * max(cell, aligned.spacing)
    intact = intact[NearCubes.around(damaged.points, reach).holds(aligned.points[intact])]
    rim = intact[np.isfinite(find_neighbours(aligned.points[intact], 1, damaged.points, reach)[0][:, 0])]
    rim = rim[pick_one_per_cube(aligned.points[rim], 0.5 * cell)] if len(rim) else rim
    if len(rim) < FEWEST:
        return behind
    few = pick_at_most(damaged.points, 0.5 * cell, MOST, 2.0)
    own = damaged.points[few]
    points = np.concatenate([own, aligned.points[rim]])
    points, normals, _ = smooth_points(points, aligned.noise, min(FIT_COUNT, len(points) // 2))
    outward = field.find_normals(rim)
    evidence = np.concatenate([np.zeros(len(own)), np.einsum("ij,ij->i", normals[len(own) :], outward)])
    normals *= find_signs(points, normals, evidence)[:, None]
    distance, near = find_neighbours(skin.points[asked], min(AROUND, len(own)), points[: len(own)])
    site = damaged.site[few][near[:, 0]]
    way = (skin.points[asked] - points[near[:, 0]]) / np.maximum(distance[:, :1], 1e-300)
    height, facing = (np.einsum("ij,ij->i", one, normals[near[:, 0]]) for one in (way, skin.normals[asked]))
    is_behind = (height < -BELOW) & (facing < -BELOW)
    # Above the flank of a groove the nearest point faces sideways: all of them round it face out.
    out = normalise(normals[near].mean(axis=1))
    over, against = (np.einsum("ij,ij->i", one, out) for one in (way, skin.normals[asked]))
    is_behind |= (over < -BELOW) & (against < -BELOW)
    thin = THIN * aligned.spacing
    # Of a wall that is thick, what a deep pit has left may be thin: there the far skin is straight below the pit.
    is_left = (distance[:, 0] < thin) & (height < -STRAIGHT) & (facing < -STRAIGHT)
    doubted = np.flatnonzero(is_behind & ~is_left)
    is_behind[doubted] = _measure_walls(part, skin.points[asked[doubted]], skin.normals[asked[doubted]]) < thin
    # The far skin is about as large as the lost one. Fewer are places where the normals are wrong.
    share = np.bincount(site, is_behind) / np.maximum(np.bincount(site), 1)
    behind[asked] = is_behind & (share[site] > LEAST_SHARE)
    return behind


def _measure_walls(part: Part, skin: Floats, normals: Floats) -> Floats:
    """How thick (S,) the part is below samples of its ``skin`` (S,3) with outward ``normals`` (S,3)."""
    if not len(skin):
        return np.zeros(0)
    step = 1e-6 * part.diagonal
    return prepare_rays(part).find_first(skin - step * normals, -normals)[0]
