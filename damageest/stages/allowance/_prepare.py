"""Opens the cavity before deposition: walls that lean outward, no undercuts, room for the cutter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import compress
from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Flags, Floats, Mesh, Part, Solid, Vector
from damageest.errors import StageError
from damageest.geometry.duplicates import list_used
from damageest.geometry.rays import prepare_rays
from damageest.geometry.refinement import halve_edges
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest.geometry.transforms import turn_to_axis
from damageest.geometry.vectors import normalise
from damageest.options import Options
from damageest.stages.allowance._booleans import touches

NODES = 160
"""Nodes of the grid along its longer side at most."""
FINE = 6.0
"""Nodes of the grid for each radius of the cutter, where there is memory for them."""
OPEN = 0.2
"""Length of the mean normal of a damage's skin below which it faces no direction."""
SHALLOW = 0.5
"""Cells of the grid by which a place has to be lower than the cutter comes for it to count as narrow."""
SLACK = 1.5
"""Cells of the grid by which the cutter is thinner where it is looked whether it comes down."""
SIMPLE = 1 / 8
"""Tolerances by which the surface of the opened cavity is simplified."""
CLEAR = 2.0
"""Tolerances by which what the cutter opens goes on above the damage where there is no metal."""
CRUMB = 1e-9
"""Share of the damage volume below which metal to mill off is rounding."""


class Prepare(Options):
    """How the cavity is opened before deposition."""

    min_radius: float = Field(
        0.0, ge=0, allow_inf_nan=False,
        description="radius of the cutter: narrower places are widened to it, in the job's unit",
    )  # fmt: skip
    wall_angle: float = Field(
        20.0, ge=0, lt=80, description="least angle between a wall and the direction of the opening, in degrees"
    )
    undercut: Literal["remove"] = Field(
        "remove",
        description="metal above the cavity, seen along the direction, is removed up to the damage's rim, and above it "
        "where it ends no higher than the damage is deep",
    )
    depth: float = Field(
        0.0,
        ge=0,
        allow_inf_nan=False,
        description="depth of intact metal to remove below the damage, in the job's unit",
    )
    direction: Vector | None = Field(
        None, description="[x, y, z] from which the cavity is milled and filled; default: the mean normal of the skin"
    )


@dataclass(frozen=True, eq=False)
class _Column:
    """What lies above a ``floor`` (X,Y), heights at the nodes of a grid from ``corner`` (2,) on, ``cell`` apart, and
    below the height ``top``."""

    floor: Floats
    corner: Floats
    cell: float
    top: float

    @property
    def places(self) -> Floats:
        """The nodes (X,Y,2)."""
        x, y = (self.corner[k] + self.cell * np.arange(self.floor.shape[k]) for k in range(2))
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)

    def place_between(self, low: float, high: float) -> tuple[Floats, Floats]:
        """Places (N,3) at two heights over the nodes whose floor is below the top."""
        places = self.places[self.floor < self.top]
        first, last = (np.column_stack([places, np.full(len(places), height)]) for height in (low, high))
        return first, last

    def raise_body(self) -> Any:
        """The column as a Manifold."""
        from manifold3d import Manifold, Mesh64

        (nx, ny), count, places = self.floor.shape, self.floor.size, self.places.reshape(-1, 2)
        # thin everywhere, so that the column is one closed body; its top lies above the damage
        below = np.column_stack([places, np.minimum(self.floor.ravel(), self.top)])
        above = np.column_stack([places, np.full(count, self.top + self.cell)])
        number = np.arange(count).reshape(nx, ny)
        a, b, c, d = (each.ravel() for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
        up = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
        ring = np.concatenate([number[:, 0], number[-1, 1:], number[-2::-1, -1], number[0, -2:0:-1]])
        on = np.roll(ring, -1)
        sides = [np.stack(one, axis=1) for one in ((ring, on, on + count), (ring, on + count, ring + count))]
        faces = np.concatenate([up[:, ::-1], up + count, *sides])
        body = Manifold(Mesh64(np.concatenate([below, above]), faces.astype(np.uint64)))
        # what is only as high as the roof's plate is no opening
        return body.trim_by_plane((0.0, 0.0, -1.0), -self.top)

    def close_below(self, aside: list[Any], kept: list[Any], turn: Floats) -> _Column:
        """The column without what takes out the bodies ``aside``, except where the bodies ``kept`` lie below or above
        them: Manifolds, which ``turn`` (3,3) turns to the frame of the column."""
        from scipy import ndimage

        def find_nodes(body: Any, cells: int) -> Flags:
            vertices, faces = to_arrays(body)
            found = np.isfinite(_lower_floor(Mesh(vertices @ turn.T, faces), self.corner, self.floor.shape, self.cell))
            return np.asarray(ndimage.binary_dilation(found, iterations=cells))

        below, used = (
            np.any([find_nodes(each, far) for each in some], axis=0) for some, far in ((aside, 2), (kept, 1))
        )
        return replace(self, floor=np.where(below & ~used, self.top, self.floor))


def open_cavity(
    damage: Solid, part: Part, others: Solid | None, prepare: Prepare, tolerance: float
) -> tuple[Solid, Solid | None]:
    """The cavity that is opened, and what takes it out of the part (see `Deposit.opening`); that of the damage, and
    None, where it is open already.

    Seen along the direction, the floor of the cavity is a height over a grid of the plane across it. It is lowered to
    the least cone round each of its places (an erosion by a cone, as of a grey image; Serra 1982), whose sides have the
    wall angle, and by a ball of the cutter's radius where it is narrower than the cutter. What lies above it, in the
    part and not above the damage's highest place, is the cavity. Metal that stands over it and ends no higher above
    that place than the damage is deep, as a shoulder, is removed too. ``others``: damage of other sites, left out.

    Raises StageError where the skin faces no direction, or nothing of the volume is left.
    """
    direction = _find_direction(damage, part, prepare)
    origin, turn = damage.bounds.mean(axis=0), turn_to_axis(direction).T
    turned = Mesh((damage.vertices - origin) @ turn.T, damage.faces)
    column = _find_column(turned, ~find_inner_faces(damage, part), part, origin, turn, prepare, tolerance)
    whole, lost = to_manifold(part, origin), to_manifold(damage, origin)

    def cut(one: _Column) -> tuple[Any, Any]:
        room = one.raise_body().simplify(SIMPLE * tolerance).transform(np.column_stack([turn.T, np.zeros(3)]))
        # joined first: where faces coincide, as those of the damage with the skin, volumes may come out wrong
        opening = room + lost
        return opening, whole ^ opening

    opening, opened = cut(column)
    kept, aside = _separate(opened, lost, tolerance)
    if aside:
        opening, opened = cut(column.close_below(aside, kept, turn))
    if others is not None:
        opened = (opened - to_manifold(others, origin)) + lost
    if opened.volume() - lost.volume() <= CRUMB * damage.volume:
        return damage, None
    cavity = to_solid(opened, origin)
    if cavity is None:
        raise StageError("the opened cavity is no solid", "use a slightly different prepare.wall_angle")
    return cavity, to_solid(opening, origin)


def _separate(opened: Any, lost: Any, tolerance: float) -> tuple[list[Any], list[Any]]:
    """The pieces of a Manifold that touch ``lost``, and those that do not."""
    pieces = [each for each in opened.decompose() if each.volume() > 0]
    touch = [touches(each, lost, tolerance) for each in pieces]
    return list(compress(pieces, touch)), list(compress(pieces, np.logical_not(touch)))


def _find_column(
    damage: Mesh, skin: Flags, part: Part, origin: Floats, turn: Floats, prepare: Prepare, tolerance: float
) -> _Column:
    """The column over the floor of the opened cavity, with z along the direction as the damage, of which the faces
    ``skin`` (F,) lie on that of the part; ``origin`` (3,) and ``turn`` (3,3): where that frame lies in the part's."""
    high, deep = float(damage.bounds[1, 2]), float(np.ptp(damage.bounds[:, 2])) + prepare.depth
    top, limit = high + tolerance / 4, high + deep

    def measure(one: _Column) -> Floats:
        low, high = (origin + places @ turn for places in one.place_between(top, limit))
        return _measure_metal(part, low, high, turn[2])

    # where nothing is in the way, it stands well out of the part, also over a sharp edge
    column = _open_floor(damage, skin, prepare, tolerance, deep + CLEAR * tolerance, high + CLEAR * tolerance)
    if (measure(column) > 0).any():
        column = _open_floor(damage, skin, prepare, tolerance, deep, top)
    if (measure(column) > 0).any():
        # metal that is higher than the damage stands over it, and is removed where it is not a wall
        higher = _open_floor(damage, skin, prepare, tolerance, deep + limit - top, limit)
        if np.isfinite(measure(higher)).all():
            column = higher
    return column


def _open_floor(damage: Mesh, skin: Flags, prepare: Prepare, tolerance: float, deep: float, top: float) -> _Column:
    """The column over the floor of the opened cavity up to the height ``top``, from which it is ``deep``. ``skin``:
    which faces (F,) of the damage lie on the part's skin."""
    from scipy import ndimage

    low, high = damage.bounds[:, :2]
    slope = 1 / np.tan(np.radians(prepare.wall_angle)) if prepare.wall_angle > 0 else np.inf
    out = deep / slope + 2 * prepare.min_radius
    size = float((high - low).max()) + 2 * out
    cell = max(min(tolerance, prepare.min_radius / FINE if prepare.min_radius else np.inf), size / NODES)
    nx, ny = (np.ceil((high - low + 2 * out) / cell).astype(int) + 5).tolist()
    corner = low - out - 2 * cell
    lowest = _lower_floor(damage, corner, (nx, ny), cell)
    # the column stands out of the part all round, also where steps of the grid or simplification round its walls
    outside = _lower_floor(Mesh(damage.vertices, damage.faces[skin]), corner, (nx, ny), cell, below=True)
    floor = np.minimum(np.minimum(lowest, outside - SIMPLE * tolerance) - prepare.depth, top)
    cone: Any = -_draw_cone(deep / slope, cell, slope) if np.isfinite(slope) else np.zeros((1, 1))
    floor = np.asarray(ndimage.grey_erosion(floor, structure=cone, mode="nearest"))
    if prepare.min_radius > 0:
        # a ball leaves upright walls round its lower half, which then lean outward too
        floor = _widen(floor, prepare.min_radius, cell, SHALLOW * cell)
        floor = np.asarray(ndimage.grey_erosion(floor, structure=cone, mode="nearest"))
    return _Column(floor, corner, cell, top)


def _measure_metal(part: Part, low: Floats, high: Floats, up: Floats) -> Floats:
    """How far (N,) the part's metal reaches from places ``low`` (N,3) to ``high`` (N,3), which lie ``up`` (3,) from
    them: 0 where there is none, and infinite where it goes on above."""
    rays = prepare_rays(part)
    face = rays.find_first(low, np.tile(up, (len(low), 1)))[1]
    goes_on = (face >= 0) & (part.face_normals[face] @ up > 0)  # of those that cross nothing before the end
    crossed, reach = rays.find_crossings(low, high), np.zeros(len(low))
    last = np.flatnonzero(np.diff(crossed.ray, append=-1))
    goes_on[crossed.ray[last]] = crossed.enters[last]
    reach[crossed.ray[last]] = crossed.distance[last]
    reach[goes_on] = np.inf
    return reach


def _find_direction(damage: Solid, part: Part, prepare: Prepare) -> Floats:
    if prepare.direction is not None:
        length = float(np.linalg.norm(prepare.direction))
        if length > 0:
            return np.asarray(prepare.direction) / length
        raise StageError("prepare.direction has no length", "give a direction [x, y, z]")
    skin = damage.cross[~find_inner_faces(damage, part)]
    total, area = skin.sum(axis=0), float(np.linalg.norm(skin, axis=1).sum())
    if not area or np.linalg.norm(total) < OPEN * area:
        raise StageError(
            "the damaged skin has no common direction to open it from, for example where the damage goes through",
            "give prepare.direction",
        )
    return np.asarray(normalise(total[None])[0])


def _lower_floor(mesh: Mesh, corner: Floats, shape: tuple[int, int], cell: float, below: bool = False) -> Floats:
    """The lowest place of a mesh in the cell round each node of a grid; infinite where there is none. ``below``: in the
    four cells between nodes that meet in each node: a surface through these heights lies nowhere above the mesh."""
    fine = halve_edges(mesh, cell / 2)
    places = fine.vertices[list_used(fine.faces)]
    place = (places[:, :2] - corner) / cell
    corners = np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    nodes = np.floor(place) + corners[:, None] if below else np.round(place)[None]
    floor = np.full(shape, np.inf)
    for node in nodes:
        np.minimum.at(floor, tuple(node.astype(int).T), places[:, 2])
    return floor


def _draw_cone(radius: float, cell: float, slope: float) -> Floats:
    count = int(np.ceil(radius / cell))
    x = np.arange(-count, count + 1) * cell
    return np.asarray(slope * np.hypot(x[:, None], x[None]))


def _widen(floor: Floats, radius: float, cell: float, least: float) -> Floats:
    """The floor, lower where neither a flat cutter nor a ball cutter comes down to it without a cut elsewhere: there a
    ball is pressed down to it."""
    from scipy import ndimage

    def shape(size: float, is_ball: bool) -> dict[str, Any]:
        count = int(np.ceil(size / cell))
        x = np.arange(-count, count + 1) * cell
        away = np.hypot(x[:, None], x[None])
        rise = size - np.sqrt(np.maximum(size**2 - away**2, 0.0)) if is_ball else np.zeros_like(away)
        return {"footprint": away <= size, "structure": -rise, "mode": "nearest"}

    # a wall is as exact as the grid
    slim = max(radius - SLACK * cell, 0.5 * radius)
    cutters = [shape(slim, is_ball) for is_ball in (False, True)]
    reached = [ndimage.grey_erosion(ndimage.grey_dilation(floor, **one), **one) for one in cutters]
    pressed = np.where(np.minimum(*reached) > floor + least, floor, floor.max())
    return np.asarray(np.minimum(floor, ndimage.grey_erosion(pressed, **shape(radius, True))))
