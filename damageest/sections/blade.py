"""The quantities of an aerofoil's outline: edges, chord, camber line and thickness.

The camber line is the line of the centres of circles that touch both sides. The edges are where it meets the outline,
continued straight from the last circle that touches both sides away from the edge. The chord joins the edges; the
thickness is the diameter of the largest circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.geometry.neighbourhoods import make_tree, query_neighbours
from damageest.geometry.vectors import normalise

ROUNDS = 3
"""How often the sides are parted anew at the edges found."""
STATIONS, PARTS = 121, 6000
"""Circles along the chord, and places on the outline that they are fitted to."""
BISECTIONS = 40
CLEAR = 1.35
"""Distance of a circle's centre from the edge, in its radii, from which it touches both sides away from the edge."""
CONTINUED = 0.06
"""Length of the camber line, as a share of the chord, that its direction at an edge is taken from."""
SLENDER = 2.5
"""Least length of an aerofoil, in thicknesses."""
THIN_ENDS = 0.72
"""Largest diameter of a circle at 4 % of the chord, as a share of the thickness: a bar with parallel sides has more."""
CORNER = np.radians(35.0)
"""Largest turn of an aerofoil's outline at one place away from its edges."""
EDGE_ZONE = 0.06
"""Share of the chord at each end that belongs to the edges."""
ALIKE = 1.15
"""Ratio of the bluntness of two edges below which the blunter is not known."""


@dataclass(frozen=True, eq=False)
class BladeShape:
    """An aerofoil in its plane. ``leading`` and ``trailing`` (2,): its edges. ``angle``: of the chord from leading to
    trailing edge, in radians from the plane's first axis. ``thickness``: diameter of the largest circle, about
    ``middle`` (2,). ``camber`` (J,2): the camber line. ``bluntness``: radius of the circle near the leading edge, in
    that near the trailing edge."""

    leading: Floats
    trailing: Floats
    thickness: float
    middle: Floats
    camber: Floats
    bluntness: float

    @property
    def chord(self) -> float:
        return float(np.linalg.norm(self.trailing - self.leading))

    @property
    def angle(self) -> float:
        way = self.trailing - self.leading
        return float(np.arctan2(way[1], way[0]))

    @property
    def thickest(self) -> float:
        """How far from the leading edge, along the chord, the outline is thickest."""
        way = self.trailing - self.leading
        return float((self.middle - self.leading) @ way / np.linalg.norm(way))


def measure_blade(outline: Floats, leading: Floats | None = None) -> BladeShape | None:
    """An aerofoil's quantities, from its outline (K,2), counter-clockwise; None where it has no camber line.

    ``leading`` (2,): direction from its middle to the leading edge; None: its blunter end.
    """
    dense = _spread(outline)
    first, second = _find_ends(dense)
    for _ in range(ROUNDS):
        found = _follow_camber(dense, first, second)
        if found is None:
            return None
        camber, radius = found
        ends = [_continue(dense, camber, radius, end, first if end == 0 else second) for end in (0, -1)]
        first, second = _nearest(dense, ends[0]), _nearest(dense, ends[1])
    at_ends = [float(np.interp(0.02, *pair)) for pair in _radii_from(camber, radius, *ends)]
    turned = at_ends[1] > at_ends[0] if leading is None else float((ends[1] - ends[0]) @ leading) > 0
    if turned:
        ends, camber, radius, at_ends = ends[::-1], camber[::-1], radius[::-1], at_ends[::-1]
    top = int(radius.argmax())
    thickness, middle = 2 * float(radius[top]), camber[top]
    if 0 < top < len(radius) - 1:  # the top of the parabola through three circles
        a, b, c = radius[top - 1 : top + 2]
        bend = a - 2 * b + c
        share = float(np.clip(0.5 * (a - c) / bend, -0.5, 0.5)) if bend < 0 else 0.0
        thickness = 2 * float(b - 0.25 * (a - c) * share)
        middle = camber[top] + share * (camber[top + 1] - camber[top - 1]) / 2
    return BladeShape(ends[0], ends[1], thickness, middle, camber, at_ends[0] / max(at_ends[1], 1e-300))


def is_blade(outline: Floats, shape: BladeShape) -> bool:
    """Whether an outline is an aerofoil: slender, thin at both ends, and without corners but at its edges."""
    if shape.chord < SLENDER * shape.thickness:
        return False
    tree = make_tree(_spread(outline))
    way = shape.trailing - shape.leading
    at = np.einsum("ij,j->i", shape.camber - shape.leading, way) / shape.chord**2
    radius = query_neighbours(tree, shape.camber, 1)[0][:, 0]
    near = [float(np.interp(share, at, radius)) for share in (0.04, 0.96)]
    if max(near) > THIN_ENDS * shape.thickness / 2:
        return False
    edges = np.roll(outline, -1, axis=0) - outline
    heading = np.arctan2(edges[:, 1], edges[:, 0])
    turn = np.abs((heading - np.roll(heading, 1) + np.pi) % (2 * np.pi) - np.pi)
    place = (outline - shape.leading) @ way / shape.chord**2
    between = (place > EDGE_ZONE) & (place < 1 - EDGE_ZONE)
    return not bool((turn[between] > CORNER).any())


def _spread(outline: Floats) -> Floats:
    """Places on an outline, about `PARTS` of them at equal distances, with its corners."""
    edges = np.roll(outline, -1, axis=0) - outline
    size = np.linalg.norm(edges, axis=1)
    parts = np.maximum(np.ceil(size / size.sum() * PARTS), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(outline)), parts)
    share = (np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[edge]
    return np.asarray(outline[edge] + share[:, None] * edges[edge])


def _find_ends(dense: Floats) -> tuple[int, int]:
    """The two places that are farthest apart."""
    from scipy.spatial import ConvexHull
    from scipy.spatial.distance import cdist

    hull = ConvexHull(dense).vertices
    hull = hull[:: max(1, len(hull) // 1500)]
    first, second = np.unravel_index(cdist(dense[hull], dense[hull]).argmax(), (len(hull), len(hull)))
    return int(hull[first]), int(hull[second])


def _nearest(dense: Floats, place: Floats) -> int:
    return int(np.linalg.norm(dense - place, axis=1).argmin())


def _part_sides(dense: Floats, first: int, second: int) -> tuple[Floats, Floats]:
    """The outline's two sides, both from the place ``first`` to ``second``."""
    turned = np.roll(dense, -first, axis=0)
    cut = (second - first) % len(dense)
    return turned[: cut + 1], np.concatenate([turned[cut:], turned[:1]])[::-1]


def _follow_camber(dense: Floats, first: int, second: int) -> tuple[Floats, Floats] | None:
    """Centres (J,2) and radii (J,) of circles that touch both sides; None where some lie outside the outline."""
    start, end = dense[first], dense[second]
    chord = float(np.linalg.norm(end - start))
    if first == second or not chord > 0:
        return None
    along = (end - start) / chord
    out = np.array([-along[1], along[0]])
    sides = _part_sides(dense, first, second)
    if min(len(side) for side in sides) < 10:
        return None
    share = (1 - np.cos(np.linspace(0.06, np.pi - 0.06, STATIONS))) / 2
    bounds, trees = [], []
    for side in sides:
        x, y = (side - start) @ along, (side - start) @ out
        order = np.argsort(x, kind="stable")
        bounds.append(np.interp(share * chord, x[order], y[order]))
        trees.append(make_tree(side))
    low, high = bounds[0].copy(), bounds[1].copy()
    for _ in range(BISECTIONS):
        y = (low + high) / 2
        places = start + (share * chord)[:, None] * along + y[:, None] * out
        gaps = [query_neighbours(tree, places, 1)[0][:, 0] for tree in trees]
        nearer = gaps[0] < gaps[1]
        low, high = np.where(nearer, y, low), np.where(nearer, high, y)
    radius = (gaps[0] + gaps[1]) / 2
    wide = np.abs(bounds[1] - bounds[0])
    if (np.abs(gaps[0] - gaps[1]) > 0.05 * np.maximum(wide, 1e-3 * chord)).any():
        return None
    return places, radius


def _radii_from(camber: Floats, radius: Floats, start: Floats, end: Floats) -> list[tuple[Floats, Floats]]:
    """For each end: distance from it, as a share of the chord, and the radius there, nearest first."""
    chord = float(np.linalg.norm(end - start))
    near = np.linalg.norm(camber - start, axis=1) / chord
    far = np.linalg.norm(camber - end, axis=1)[::-1] / chord
    return [(near, radius), (far, radius[::-1])]


def _continue(dense: Floats, camber: Floats, radius: Floats, end: int, corner: int) -> Floats:
    """Where the camber line, continued straight, meets the outline at one end."""
    line = camber if end == 0 else camber[::-1]
    size = radius if end == 0 else radius[::-1]
    chord = float(np.linalg.norm(line[-1] - line[0]))
    gap = np.linalg.norm(line - dense[corner], axis=1)
    clear = gap > CLEAR * size
    begin = int(clear.argmax()) if clear.any() else 0
    way = np.linalg.norm(line - line[begin], axis=1)
    reach = max(CONTINUED * chord, float(size[begin]))
    some = np.arange(len(line)) >= begin
    some &= way <= max(reach, float(np.sort(way[some])[min(4, some.sum() - 1)]))
    weights = np.polynomial.polynomial.polyfit(way[some], line[some], 2 if some.sum() > 4 else 1)
    direction = -normalise(weights[1:2])[0]
    place = weights[0]
    # the place of the outline that is farthest along this direction, as near to the line as it is dense
    off = dense - place
    ahead = off @ direction
    beside = off @ np.array([-direction[1], direction[0]])
    return _cross(place, direction, ahead, beside)


def _cross(place: Floats, direction: Floats, ahead: Floats, beside: Floats) -> Floats:
    """Where a ray crosses a closed outline first, given in the ray's coordinates; its start where it does not."""
    after = np.roll(beside, -1)
    crossed: Flags = (beside < 0) != (after < 0)
    share = beside[crossed] / (beside[crossed] - after[crossed])
    at = ahead[crossed] + share * (np.roll(ahead, -1)[crossed] - ahead[crossed])
    at = at[at > 0]
    return np.asarray(place + (at.min() if len(at) else 0.0) * direction)
