"""How much more a tool is tilted than it has to be, place by place along a path.

The distances are the planner's; which tilt is needed is found anew for each place alone, whatever is before or after.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles, draw_beads
from damageest_paths.layers import Layers
from damageest_paths.process.frames import find_across
from damageest_paths.tool.nozzle import Cone, make_nozzle
from damageest_paths.tool.sight import Beam

from damageest.artefacts import DepositPath, Floats, Mesh, Solid
from damageest.geometry.vectors import normalise

MOST = 600
"""Places of a path that are looked at, as far from each other along it."""
RING, AROUND = 5.0, 12
"""Degrees between the tilts that are tried, and the ways round in which each is; less than one counts as none."""


class Beyond(NamedTuple):
    """Degrees by which the tool leans more than it has to, from the layer's normal or, where the machine does not
    permit that, the axis nearest to it: the median, 95 % and mean over a path."""

    median: float
    most: float
    mean: float


def measure_beyond_need(path: DepositPath, metal: Solid, stage: Layers) -> Beyond:
    """The tilts of a path beyond the smallest at which the nozzle keeps its distance from metal and earlier layers, and
    its beam is free. ``stage``: what it was planned with; its nozzle is no mesh."""
    on = np.flatnonzero(path.on)
    if not len(on):
        return Beyond(0.0, 0.0, 0.0)
    along = np.cumsum(path.moves[on])
    places = on[np.unique(np.searchsorted(along, (np.arange(MOST) + 0.5) / MOST * along[-1]).clip(0, len(on) - 1))]
    best = _list_best(path, np.radians(stage.machine.tilt))[places]
    lean = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", path.axes[places], best), -1, 1)))
    tilted = np.flatnonzero(lean >= RING)
    if not len(tilted):
        return Beyond(0.0, 0.0, 0.0)
    clearances = _list_clearances(path, metal, stage)
    rank = np.unique(np.stack([path.part, path.layer]), axis=1, return_inverse=True)[1].ravel()
    beyond = []
    for k in tilted:
        own = places[k]
        tried = _list_tilts(best[k], path.axes[own], float(lean[k]))
        is_seen = np.concatenate(tried) @ path.normals[own] >= np.cos(np.radians(stage.incidence)) - 1e-6
        point = np.tile(path.points[own] - metal.bounds.mean(axis=0), (len(is_seen), 1))
        needed = stage.clearance or stage.width / 4
        is_free = clearances.after(int(rank[own])).bound(point, np.concatenate(tried), needed)[0] >= needed
        rings = np.repeat(np.arange(len(tried)), [len(ring) for ring in tried])
        free = rings[is_seen & is_free]
        beyond.append(float(lean[k]) - RING * int(free[0]) if len(free) else 0.0)
    # what is less than a step between two tilts is none
    spare = np.zeros(len(places))
    spare[tilted] = np.where(np.array(beyond) >= RING, beyond, 0.0)
    return Beyond(float(np.median(spare)), float(np.quantile(spare, 0.95)), float(spare.mean()))


def _list_best(path: DepositPath, tilt: float) -> Floats:
    """The layer's normals (N,3), turned towards the build direction where they lean more than a ``tilt`` from it."""
    up = path.directions[path.part - 1]
    rise = np.einsum("ij,ij->i", path.normals, up)
    side = normalise(path.normals - rise[:, None] * up, 1e-12)
    angle = np.minimum(np.arccos(np.clip(rise, -1, 1)), tilt)
    return np.asarray(np.cos(angle)[:, None] * up + np.sin(angle)[:, None] * side)


def _list_tilts(best: Floats, axis: Floats, lean: float) -> list[Floats]:
    """Axes (K,3) at each tilt from the ``best`` (3,), from none to less than ``lean`` degrees; the first way round is
    that of the ``axis`` (3,)."""
    side = axis - (axis @ best) * best
    first = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-9 else find_across(best)
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    ways = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * np.cross(best, first)
    rings = np.radians(np.arange(RING, lean, RING))
    return [best[None], *(np.cos(ring) * best + np.sin(ring) * ways for ring in rings)]


def _list_clearances(path: DepositPath, metal: Solid, stage: Layers) -> Clearance:
    """The nozzle among metal, rank 0, and the beads of each layer, whose rank is one more than its number from 0."""
    shape, width, origin = stage.nozzle, path.width, metal.bounds.mean(axis=0)
    cone = Cone(shape.tip_radius or 0.0, shape.body_radius or 0.0, shape.length or 0.0, np.radians(shape.cone_angle))
    beam = Beam(shape.beam.radius or width / 2, np.radians(shape.beam.cone), np.radians(stage.incidence))
    meshes = [Mesh(metal.vertices - origin, metal.faces)]
    layers, rank = np.unique(np.stack([path.part, path.layer]), axis=1, return_inverse=True)
    for number in range(layers.shape[1]):
        own = np.flatnonzero(path.on & (rank.ravel() == number))
        height = float(path.heights[layers[0, number] - 1])
        start, stop = path.points[own - 1] - origin, path.points[own] - origin
        meshes.append(draw_beads(start, stop, path.normals[own], width, height))
    points = path.points[path.on] - origin
    near = Obstacles(meshes, points.min(axis=0), points.max(axis=0), width, list(range(len(meshes))))
    return Clearance(make_nozzle(cone), path.standoff, near, beam=beam)
