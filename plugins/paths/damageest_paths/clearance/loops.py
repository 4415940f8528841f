"""Distances of the nozzle from a tree of boxes, in loops that the Numba library compiles.

Each pose goes down the tree alone, to the nearest box first, and stops where it is decided. This module is imported
where it is used only: Numba takes a third of a second to load. Compiled loops are kept until this file changes. So
nothing that is compiled comes from another file, and the loops take plain arrays: a kept one that names a class cannot
be read once that has moved.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest_paths.clearance.boxes import Tree
from damageest_paths.clearance.compiling import compile_loops

CUTS = 9
"""How often a triangle is cut in four at most. An edge is 500 times shorter then."""
MOST_PIECES = 5_000
"""Pieces of triangles that one pose looks at: where more are open, the exact distance costs less."""
DEPTH = 16
"""Levels of a tree at most."""
LATER = 4096
"""Triangles of a pose that may wait to be cut until all others were looked at."""

Open = tuple[Ints, Floats, Floats]
"""The boxes that are open: their numbers, a distance that all of each keeps, and that of its middle."""


def describe_shape(profile: Floats, endless: bool) -> Floats:
    """Of a nozzle's ``profile`` (K,2), see `Nozzle`: radius of the tip and of the body, height at which the body
    begins, the cone's direction (2,) and length, and the height of the end. ``endless``: the body goes on above it."""
    rise, tip = profile[1, 0], profile[0, 1]
    over, aside = rise - profile[0, 0], profile[1, 1] - tip
    length = np.hypot(over, aside)
    end = np.inf if endless else profile[-1, 0]
    return np.array([tip, profile[-1, 1], rise, over / length, aside / length, length, end])


@compile_loops
def _measure_profile(height: float, radius: float, shape: Floats) -> tuple[float, float, float]:
    """Distance of a point, at a height above the tip and a radius from the axis, to the surface of a nozzle with this
    ``shape`` (7,), see `describe_shape`; negative inside. And its slopes along height and radius.

    The profile is that of `Cone`: from the tip upward, never narrower. So it is convex: the distance is the largest of
    those to the lines of its sides, but where a corner is nearest.
    """
    rise, up, out = shape[2], shape[3], shape[4]
    beside, beyond, above = radius - shape[0], radius - shape[1], height - shape[6]
    along = height * up + beside * out
    if above > 0 and beyond > 0:
        away = np.sqrt(above * above + beyond * beyond)
        return away, above / away, beyond / away
    if along > shape[5] and height < rise:
        over = height - rise
        away = np.sqrt(over * over + beyond * beyond)
        return away, over / away, beyond / away
    if along < 0 and beside > 0:
        away = np.sqrt(height * height + beside * beside)
        return away, height / away, beside / away
    cone = beside * up - height * out
    if cone >= max(beyond, -height, above):
        return cone, -out, up
    if beyond >= max(-height, above):
        return beyond, 0.0, 1.0
    return (-height, -1.0, 0.0) if -height >= above else (above, 1.0, 0.0)


@compile_loops
def _find_tangent(
    x: float, y: float, z: float, tip: Floats, axis: Floats, shape: Floats
) -> tuple[float, float, float, float]:
    """Distance of a point to the nozzle with its ``tip`` (3,) and ``axis`` (3,), negative inside; and its slope.

    The distance to a convex solid is a convex function: it lies above its tangent everywhere.
    """
    x, y, z = x - tip[0], y - tip[1], z - tip[2]
    height = x * axis[0] + y * axis[1] + z * axis[2]
    x, y, z = x - height * axis[0], y - height * axis[1], z - height * axis[2]
    radius = np.sqrt(x * x + y * y + z * z)
    own, over, aside = _measure_profile(height, radius, shape)
    aside /= max(radius, 1e-300)
    return own, over * axis[0] + aside * x, over * axis[1] + aside * y, over * axis[2] + aside * z


@compile_loops
def _bound_triangle(corners: Floats, tip: Floats, axis: Floats, shape: Floats) -> tuple[float, float]:
    """Distance of the middle of a triangle with ``corners`` (9,), and one that all of it keeps at least."""
    x = (corners[0] + corners[3] + corners[6]) / 3
    y = (corners[1] + corners[4] + corners[7]) / 3
    z = (corners[2] + corners[5] + corners[8]) / 3
    own, u, v, w = _find_tangent(x, y, z, tip, axis, shape)
    lowest = min(
        u * corners[0] + v * corners[1] + w * corners[2],
        u * corners[3] + v * corners[4] + w * corners[5],
        u * corners[6] + v * corners[7] + w * corners[8],
    )
    return own, own + lowest - u * x - v * y - w * z


@compile_loops
def bound_poses(
    tips: Floats, axes: Floats, shape: Floats, needed: float, far: float, is_tight: bool, tree: Tree, floor: float,
    until: int, low: Floats, high: Floats,
) -> None:  # fmt: skip
    """Fills in ``low`` and ``high`` (N,) for poses with ``tips`` and ``axes`` (N,3); see `Descent.bound`. Distances
    from ``far`` on need not be known well."""
    middle, _, _, _, height, _, first, _, _, turn = tree
    open_ = _make_open(tree)
    box, lower, own = open_
    later, pieces = np.empty(LATER, np.int64), np.empty((3 * CUTS + 5, 10))
    tip, axis, last = np.empty(3), np.empty(3), -1
    for k in range(len(tips)):
        _turn_back(tips[k], turn, tip)
        _turn_back(axes[k], turn, axis)
        if last >= 0 and not is_tight:  # what was too near for the pose before often is for this one
            away = _find_tangent(middle[last, 0], middle[last, 1], middle[last, 2], tip, axis, shape)
            if away[0] < needed:
                low[k], high[k] = 0.0, max(away[0], 0.0)
                continue
        least, most, kept = np.inf, np.inf, 0
        size = _open_boxes(-1, 0, tip, axis, shape, tree, floor, until, open_)
        while size and most > 0 and (is_tight or most >= needed):
            size -= 1
            one = box[size]
            if lower[size] >= min(far, most):
                least = min(least, lower[size])
                continue
            if first[one] >= 0:
                size = _open_boxes(one, size, tip, axis, shape, tree, floor, until, open_)
                continue
            _take_corners(tree, one, pieces[0])
            _, nearest = _bound_triangle(pieces[0], tip, axis, shape)
            if height[one] > floor and own[size] < most:
                most, last = max(own[size], 0.0), one
            if nearest < needed and kept < LATER:
                later[kept] = one
                kept += 1
            else:
                least = min(least, nearest)
        count = 0
        while kept and most >= needed:  # no place looked at so far is too near
            kept -= 1
            _take_corners(tree, later[kept], pieces[0])
            most, found, count = _cut_triangle(pieces, tip, axis, turn[2], shape, needed, floor, most, count)
            least = min(least, found)
            if most < needed and height[later[kept]] > floor:
                last = later[kept]
        low[k], high[k] = 0.0 if most < needed else least, most


@compile_loops
def _turn_back(vector: Floats, turn: Floats, into: Floats) -> None:
    """A ``vector`` (3,) in the coordinates before a ``turn`` (3,3)."""
    for side in range(3):
        into[side] = vector[0] * turn[0, side] + vector[1] * turn[1, side] + vector[2] * turn[2, side]


@compile_loops
def _take_corners(tree: Tree, one: int, into: Floats) -> None:
    """The corners of the triangle of a box of the last level, as the first nine of ``into``."""
    corners = tree[8]
    number = one - len(tree[0]) + len(corners)
    for corner in range(3):
        for side in range(3):
            into[3 * corner + side] = corners[number, corner, side]


@compile_loops
def _make_open(tree: Tree) -> Open:
    """Room for the boxes that are open: of each level as many as a box holds, and those of the first."""
    roots, members = tree[7]
    room = roots + DEPTH * members
    return np.empty(room, np.int64), np.empty(room), np.empty(room)


@compile_loops
def _open_boxes(
    parent: int, size: int, tip: Floats, axis: Floats, shape: Floats, tree: Tree, floor: float, until: int, open_: Open
) -> int:
    """Adds the boxes that a ``parent`` holds, or for -1 those of the first level, to the open ones, the nearest last,
    but for those that do not count. ``size``: how many are open; the new number is returned."""
    middle, half, _, top, _, rank, first, sizes, _, _ = tree
    box, lower, own = open_
    begin, count, start = 0, sizes[0], size
    if parent >= 0:
        begin, count = first[parent], sizes[1]
    for one in range(begin, begin + count):
        if not (top[one] > floor and rank[one] <= until):
            continue
        away, u, v, w = _find_tangent(middle[one, 0], middle[one, 1], middle[one, 2], tip, axis, shape)
        nearest = away - abs(u) * half[one, 0] - abs(v) * half[one, 1] - abs(w) * half[one, 2]
        place = size
        while place > start and lower[place - 1] < nearest:
            box[place], lower[place], own[place] = box[place - 1], lower[place - 1], own[place - 1]
            place -= 1
        box[place], lower[place], own[place] = one, nearest, away
        size += 1
    return size


@compile_loops
def _cut_triangle(
    pieces: Floats, tip: Floats, axis: Floats, up: Floats, shape: Floats, needed: float, floor: float, most: float,
    count: int,
) -> tuple[float, float, int]:  # fmt: skip
    """``most``, lowered to the distance of places on a triangle; a distance that all of it keeps; and ``count``, with
    the pieces that were looked at. The triangle is cut in four where it may be too near, until each piece decides.

    ``pieces`` (K,10): room for the open ones, their corners and how often they were cut; the first is the triangle.
    ``up`` (3,): the direction in which a height is measured.
    """
    piece, least, size = pieces[-1], np.inf, 1
    pieces[0, 9] = 0
    while size:
        size -= 1
        for k in range(10):  # an assignment of the whole row takes four seconds to compile
            piece[k] = pieces[size, k]
        count += 1
        heights = (
            up[0] * piece[0] + up[1] * piece[1] + up[2] * piece[2],
            up[0] * piece[3] + up[1] * piece[4] + up[2] * piece[5],
            up[0] * piece[6] + up[1] * piece[7] + up[2] * piece[8],
        )
        if max(heights) <= floor:
            continue
        own, lower = _bound_triangle(piece, tip, axis, shape)
        if heights[0] + heights[1] + heights[2] > 3 * floor:
            most = min(most, max(own, 0.0))
            if most < needed:
                break
        if lower >= needed or piece[9] >= CUTS or count > MOST_PIECES:
            least = min(least, lower)
            continue
        for kind in range(4):  # the pieces at the corners, and that in the middle
            for k in range(9):
                corner = 3 * kind + k % 3
                other = piece[corner] + piece[k] if kind < 3 else piece[(k + 3) % 9] + piece[(k + 6) % 9]
                pieces[size, k] = other / 2
            pieces[size, 9] = piece[9] + 1
            size += 1
    return most, least, count


@compile_loops
def mark_near_ranks(
    place: Floats, along: Floats, shape: Floats, limit: float, tree: Tree, floor: float, until: int, near: Flags
) -> None:
    """Marks in ``near`` (R,) each rank of which something may be nearer than ``limit`` to the nozzle with its tip at a
    ``place`` (3,) and its axis ``along`` a direction (3,)."""
    _, _, _, _, _, rank, first, _, _, turn = tree
    tip, axis, open_ = np.empty(3), np.empty(3), _make_open(tree)
    _turn_back(place, turn, tip)
    _turn_back(along, turn, axis)
    box, lower, _ = open_
    size = _open_boxes(-1, 0, tip, axis, shape, tree, floor, until, open_)
    while size:
        size -= 1
        if lower[size] < limit:
            one = box[size]
            if first[one] < 0:
                near[rank[one]] = True
            else:
                size = _open_boxes(one, size, tip, axis, shape, tree, floor, until, open_)


@compile_loops
def bound_stretches(
    points: Floats, axes: Floats, standoff: float, shift: Floats, turn: Floats, shape: Floats, wanted: float,
    tree: Tree, floor: float, until: int, found: Floats,
) -> None:  # fmt: skip
    """Fills in ``found`` (N,); see `Descent.bound_stretches`."""
    middle, _, radius, _, _, _, first, _, _, turned = tree
    open_ = _make_open(tree)
    box, lower, own = open_
    corners, point, tip, axis = np.empty(9), np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(points)):
        _turn_back(points[k], turned, point)
        _turn_back(points[k] + standoff * axes[k], turned, tip)
        _turn_back(axes[k], turned, axis)
        least = 2 * wanted
        size = _open_boxes(-1, 0, tip, axis, shape, tree, floor, until, open_)
        while size:
            size -= 1
            one = box[size]
            # the place of the nozzle that comes near is as far from the point it works on as the obstacle, and the
            # distance between them
            x, y, z = middle[one, 0] - point[0], middle[one, 1] - point[1], middle[one, 2] - point[2]
            reach = np.sqrt(x * x + y * y + z * z)
            room = turn[k] * (reach + max(own[size], 0.0) + radius[one]) + shift[k]
            if lower[size] - room >= wanted:
                least = min(least, lower[size] - room)
            elif first[one] >= 0:
                size = _open_boxes(one, size, tip, axis, shape, tree, floor, until, open_)
            else:
                _take_corners(tree, one, corners)
                least = min(least, _bound_triangle(corners, tip, axis, shape)[1] - room)
                if least < wanted:
                    break
        found[k] = least if least >= wanted else -np.inf
