"""What a place on a pass is like, as far as the process depends on it: how the pass bends, how wide the metal is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import DepositPath, Flags, Floats, Mesh, Solid
from damageest.geometry.distance import is_inside
from damageest.geometry.rays import RayCaster
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.geometry.transforms import turn_to_axis
from damageest.geometry.vectors import normalise
from damageest_paths.process.process import measure_along

CHORDS = 8
"""Directions across the layer's normal along which the metal is measured."""


def cut_moves(path: DepositPath, longest: float = 1.0) -> tuple[DepositPath, Flags]:
    """The path with moves that deposit cut so that none is longer than ``longest`` bead widths; and which (N,) of its
    points are those of the path as it was."""
    most = longest * path.width
    counts = np.where(path.on, np.maximum(np.ceil(path.moves / most - 1e-9), 1), 1).astype(int)
    rows = np.repeat(np.arange(len(counts)), counts)
    share = np.concatenate([np.arange(1, count + 1) / count for count in counts])[:, None]
    before = np.maximum(rows - 1, 0)
    names = ("feed", "on", "layer", "number", "part", "values", "bead_sizes", "dwell")
    columns = {name: own[rows] for name in names if (own := getattr(path, name)) is not None}
    points, axes, normals = (
        own[before] + share * (own[rows] - own[before]) for own in (path.points, path.axes, path.normals)
    )
    axes, normals = normalise(axes), normalise(normals)
    is_end = share[:, 0] == 1
    if path.dwell is not None:
        columns["dwell"] = np.where(is_end, columns["dwell"], 0.0)
    points[is_end], axes[is_end], normals[is_end] = path.points, path.axes, path.normals
    return replace(path, points=points, axes=axes, normals=normals, **columns), is_end


def find_middles(path: DepositPath) -> Floats:
    """The middle (N,3) of each move; of the first its point."""
    return np.concatenate([path.points[:1], (path.points[:-1] + path.points[1:]) / 2])


def measure_radius(path: DepositPath) -> Floats:
    """The radius (N,) of the circle through the middle of each move that deposits and the places of its pass a bead's
    width before and behind; inf where the pass is straight, and on travel."""
    found = np.full(len(path.points), np.inf)
    for number in np.unique(path.number[path.on]):
        own = np.flatnonzero((path.number == number) & path.on)
        line = path.points[np.append(own[0] - 1, own)]
        along = measure_along(line)
        reach = min(path.width, along[-1] / 2)
        middle = np.clip((along[1:] + along[:-1]) / 2, reach, along[-1] - reach)
        a, b, c = (
            np.column_stack([np.interp(middle + shift, along, line[:, k]) for k in range(3)])
            for shift in (-reach, 0.0, reach)
        )
        sides = [np.linalg.norm(one - other, axis=1) for one, other in ((a, b), (b, c), (c, a))]
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        is_bent = area > 1e-6 * reach**2
        found[own[is_bent]] = np.prod(sides, axis=0)[is_bent] / (4 * area[is_bent])
    return found


def measure_widths(path: DepositPath, body: Solid, left: Solid | None) -> Floats:
    """How wide the finished metal is (N,) at the middle of each move that deposits: the shortest of some chords across
    the normal of the layer, half a layer below the top of the bead. Beside the metal, that of the nearest place of the
    pass within it, the bead's width where there is none; inf on travel.

    ``body``: the deposit, ``left``: what is left of the part, both in the path's frame.
    """
    metal = to_manifold(body) if left is None else to_manifold(body) + to_manifold(left)
    mesh = Mesh(*to_arrays(metal))
    found = np.full(len(path.points), np.inf)
    own = np.flatnonzero(path.on)
    if not len(own):
        return found
    normals = path.normals[own]
    places = find_middles(path)[own] - path.heights[path.part[own] - 1, None] / 2 * normals
    caster, least = RayCaster(mesh), np.full(len(own), np.inf)
    first, second = _span_planes(normals)
    for angle in np.arange(CHORDS) * np.pi / CHORDS:
        along = np.cos(angle) * first + np.sin(angle) * second
        chord = caster.find_first(places, along)[0] + caster.find_first(places, -along)[0]
        least = np.minimum(least, chord)
    within = is_inside(places, mesh) & np.isfinite(least)
    for number in np.unique(path.number[own]):
        pass_ = np.flatnonzero(path.number[own] == number)
        known = pass_[within[pass_]]
        if len(known):
            after = np.searchsorted(known, pass_)
            before, after = known[np.maximum(after - 1, 0)], known[np.minimum(after, len(known) - 1)]
            least[pass_] = least[np.where(np.abs(pass_ - before) < np.abs(after - pass_), before, after)]
        else:
            least[pass_] = path.width
    found[own] = least
    return found


def _span_planes(normals: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (N,3) each, at right angles to the ``normals`` (N,3) and to each other."""
    kinds, number = np.unique(np.round(normals, 9), axis=0, return_inverse=True)
    turns = np.array([turn_to_axis(kind) for kind in kinds])[number.ravel()]
    return turns[:, :, 0], turns[:, :, 1]
