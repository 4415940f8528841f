"""Divides an inner damage surface into planes, cylinders and spheres: what a cut, a drill and a ball leave.

Kinds are tried on neighbourhoods of random triangles, the fit that explains most area is taken, then what is left is
tried again: the idea of Schnabel, Wahl, Klein, "Efficient RANSAC for Point-Cloud Shape Detection", 2007.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.edges import list_edges

Kind = Literal["plane", "cylinder", "sphere"]
TRIES = 60
MOST = 12
"""Largest number of recognised faces of one surface: a surface that takes more is not made of them."""
ALIKE = np.cos(np.radians(25))
"""Least cosine between the normals of a triangle and of its shape."""
LARGE = 0.06
"""Share of the surface from which a shape is worth looking for in any case."""
LEAST = 0.004
"""Smallest share of the surface that is a face of its own."""


@dataclass(frozen=True, eq=False)
class Shape:
    """``point`` (3,): on the plane or the axis, or the centre; ``axis`` (3,): the plane's normal or the axis."""

    kind: Kind
    point: Floats
    axis: Floats
    radius: float = 0.0

    def measure(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distance (N,) of points (N,3), and the unit normals (N,3) of the surface at them."""
        off = points - self.point
        if self.kind == "plane":
            return off @ self.axis, np.broadcast_to(self.axis, points.shape)
        if self.kind == "cylinder":
            off = off - np.outer(off @ self.axis, self.axis)
        length = np.maximum(np.linalg.norm(off, axis=1), 1e-300)
        return length - self.radius, off / length[:, None]


@dataclass(frozen=True, eq=False)
class _Samples:
    points: Floats
    normals: Floats
    areas: Floats
    graph: coo_array


def recognise(mesh: Mesh, close: float, left: float = 0.0, seed: int = 1) -> tuple[list[Shape], Ints]:
    """The shapes of a surface, and for each face (F,) the number of its shape, -1 where none lies within ``close``.

    It ends early where further shapes of the last one's size would leave more than a share ``left`` of the surface, and
    none of them is large: such a surface is not made of them.
    """
    samples = _Samples(mesh.triangles.mean(1), mesh.face_normals, 2 * mesh.face_areas, _link(mesh.faces))
    rng = np.random.default_rng(seed)
    label = np.full(len(mesh.faces), -1, np.int64)
    shapes: list[Shape] = []
    total = samples.areas.sum()
    while len(shapes) < MOST:
        free = label < 0
        if samples.areas[free].sum() < LEAST * total:
            break
        found = _find_largest(samples, free, close, rng)
        if found is None or samples.areas[found[1]].sum() < LEAST * total:
            break
        label[found[1]] = len(shapes)
        shapes.append(found[0])
        size = samples.areas[found[1]].sum()
        if size < LARGE * total and samples.areas[label < 0].sum() - (MOST - len(shapes)) * size > left * total:
            break
    return shapes, label


def find_neighbours(faces: Ints) -> tuple[Ints, Ints]:
    """Pairs of triangles (N,) and (N,) that share an edge."""
    edges = list_edges(faces)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort(edges.T)
    same = (edges[order][1:] == edges[order][:-1]).all(1)
    return owner[order][:-1][same], owner[order][1:][same]


def _link(faces: Ints) -> coo_array:
    one, two = find_neighbours(faces)
    return coo_array((np.ones(len(one), bool), (one, two)), shape=(len(faces), len(faces)))


def _find_largest(samples: _Samples, free: Flags, close: float, rng: np.random.Generator) -> tuple[Shape, Flags] | None:
    from scipy.spatial import cKDTree

    rows = np.flatnonzero(free)
    tree = cKDTree(samples.points[rows])
    weights = samples.areas[rows] / samples.areas[rows].sum()
    best: tuple[float, Shape, Flags] | None = None
    reach = np.sqrt(samples.areas[rows].sum() / 2)
    thin = rows if len(rows) <= 4000 else np.sort(rng.choice(rows, 4000, replace=False))
    for k in rng.choice(len(rows), TRIES, p=weights):
        radius = reach * rng.choice([0.05, 0.1, 0.2, 0.4])
        near = rows[tree.query_ball_point(samples.points[rows[k]], radius)]
        if len(near) < 12:
            continue
        near = near if len(near) <= 400 else rng.choice(near, 400, replace=False)
        for kind in ("plane", "cylinder", "sphere"):
            shape = _fit(kind, samples, near)
            if shape is None:
                continue
            score = samples.areas[thin][_fits(shape, samples, thin, close)].sum()
            # a kind with more freedom has to explain more
            score *= {"plane": 1.0, "cylinder": 0.9, "sphere": 0.95}[kind]
            if best is None or score > best[0]:
                best = score, shape, free
    if best is None:
        return None
    shape, chosen = best[1], None
    for _ in range(4):
        inside = np.zeros(len(free), bool)
        inside[rows] = _fits(shape, samples, rows, close)
        inside = _take_largest(inside, samples)
        if inside.sum() < 12:
            return None
        chosen = inside
        refined = _fit(shape.kind, samples, np.flatnonzero(inside))
        if refined is None:
            break
        shape = refined
    assert chosen is not None
    return shape, chosen


def _fits(shape: Shape, samples: _Samples, rows: Ints, close: float) -> Flags:
    distance, normal = shape.measure(samples.points[rows])
    along = np.abs(np.einsum("ij,ij->i", normal, samples.normals[rows]))
    return np.asarray((np.abs(distance) <= close) & (along >= ALIKE))


def _take_largest(inside: Flags, samples: _Samples) -> Flags:
    graph = samples.graph
    kept = inside[graph.row] & inside[graph.col]
    part = coo_array((graph.data[kept], (graph.row[kept], graph.col[kept])), shape=graph.shape)
    label = connected_components(part, directed=False)[1]
    area = np.bincount(label, weights=samples.areas * inside)
    return np.asarray(inside & (label == area.argmax()))


def _fit(kind: Kind, samples: _Samples, rows: Ints) -> Shape | None:
    points, normals, areas = samples.points[rows], samples.normals[rows], samples.areas[rows]
    centre = areas @ points / areas.sum()
    off = points - centre
    if kind == "plane":
        axes = np.linalg.eigh(off.T @ (off * areas[:, None]))[1]
        return Shape("plane", centre, axes[:, 0])
    if kind == "sphere":
        solved = _solve_round(off, areas)
        if solved is None:
            return None
        middle, radius = solved
        return Shape("sphere", centre + middle, np.array([0.0, 0.0, 1.0]), radius)
    spread, axes = np.linalg.eigh(normals.T @ (normals * areas[:, None]))
    if spread[1] < 1e-4 * spread[2]:
        return None
    axis, across = axes[:, 0], axes[:, 1:]
    solved = _solve_round(off @ across, areas)
    if solved is None:
        return None
    middle, radius = solved
    return _refine_cylinder(Shape("cylinder", centre + across @ middle, axis, radius), points, areas)


def _solve_round(off: Floats, areas: Floats) -> tuple[Floats, float] | None:
    """Centre and radius of the circle or sphere nearest to points, by the algebraic fit."""
    root = np.sqrt(areas)[:, None]
    A = np.column_stack([2 * off, np.ones(len(off))])
    solution = np.linalg.lstsq(A * root, (off * off).sum(1) * root[:, 0], rcond=None)[0]
    squared = solution[-1] + solution[:-1] @ solution[:-1]
    size = np.linalg.norm(np.ptp(off, axis=0))
    if squared <= 0 or squared > (5 * size) ** 2:
        return None
    return solution[:-1], float(np.sqrt(squared))


def _refine_cylinder(shape: Shape, points: Floats, areas: Floats) -> Shape:
    """Gauss-Newton steps on the distance from points to the cylinder."""
    for _ in range(5):
        side = np.linalg.svd(shape.axis[None])[2][1:]
        distance, normal = shape.measure(points)
        along = (points - shape.point) @ shape.axis
        slope = normal @ side.T
        J = np.column_stack([-slope, -along[:, None] * slope, -np.ones(len(points))])
        root = np.sqrt(areas)[:, None]
        step = np.linalg.lstsq(J * root, -distance * root[:, 0], rcond=1e-10)[0]
        axis = shape.axis + step[2:4] @ side
        radius = shape.radius + float(step[4])
        if radius <= 0 or np.linalg.norm(step[2:4]) > 0.5:
            return shape
        shape = Shape("cylinder", shape.point + step[:2] @ side, axis / np.linalg.norm(axis), radius)
    return shape
