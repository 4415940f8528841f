"""What scanners at known positions see of a mesh: rays at even angular steps, first hits only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Mesh
from damageest.errors import StageError
from damageest.geometry.rays import RayCaster
from damageest.geometry.vectors import cross_corners, normalise

Keep = Callable[[Floats], Floats]
"""A function of points (N,3) that gives the probability (N,) with which each is kept."""

WIDEST = 0.7
"""Least cosine between the direction to a triangle's centre and to its corners; wider triangles are divided."""

STEEPEST = 10.0
"""Depth that a surface may gain from one ray to the next, in distances between rays; more is a jump from a foreground
to a background."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Points (N,3), the face (N,) and the scanner (N,) of each, ``facing`` (N,): the cosine of its incidence angle, and
    ``step``: the angle between rays, in radians."""

    points: Floats
    face: Ints
    view: Ints
    facing: Floats
    step: float


@dataclass(frozen=True, eq=False)
class Stripes:
    """Planes of light through the scanner, ``gap`` apart at ``centre`` (3,), on which all points lie."""

    gap: float
    centre: Floats
    seed: int

    def move_rays(self, position: Floats, number: int, points: Floats) -> Floats:
        """The rays (N,3), unit, from ``position`` (3,) of scanner ``number`` to points (N,3), each turned into the
        nearest plane. The planes have a random direction in each view."""
        axis = normalise(self.centre - position)
        across = np.random.default_rng([6367, self.seed, number]).normal(size=3)
        across = normalise(across - across @ axis * axis)
        way = points - position
        way = way / (way @ axis)[:, None]
        step = self.gap / float(np.linalg.norm(self.centre - position))
        place = way @ across
        return normalise(way + (step * np.round(place / step) - place)[:, None] * across)


def spread_scanners(count: int, centre: Floats, distance: float, rng: np.random.Generator) -> Floats:
    """Positions (count,3) evenly over a sphere (a Fibonacci spiral), turned at random."""
    from scipy.spatial.transform import Rotation

    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, np.pi * (1 + 5**0.5) * i
    r = np.sqrt(1 - z * z)
    directions = np.column_stack([r * np.cos(turn), r * np.sin(turn), z])
    return np.asarray(centre + distance * directions @ Rotation.random(random_state=rng).as_matrix().T)


def find_visible(caster: RayCaster, position: Floats, points: Floats, face: Ints, slack: float) -> NDArray[np.bool_]:
    """Whether each of the points (N,3) on faces (N,) is the first that a ray from ``position`` (3,) meets.

    ``slack``: how far in front of a point a surface may be and count as the same.
    """
    way = points - position
    distance = np.linalg.norm(way, axis=1)
    first, hit = caster.find_first(np.broadcast_to(position, way.shape), way / distance[:, None])
    return np.asarray((hit == face) | (first > distance - slack))


def sample_views(
    mesh: Mesh,
    faces: NDArray[np.bool_],
    scanners: Floats,
    count: int,
    max_incidence: float,
    rng: np.random.Generator,
    keep: Keep | None = None,
    stripes: Stripes | None = None,
) -> Seen:
    """``count`` points of a mesh that scanners (V,3) see, on ``faces`` (F,) only, in random order.

    Every scanner has the same angular step, so that the density of a view's points falls with the cosine of the
    incidence angle over the squared distance. Each triangle is projected on a plane across the ray to its centre; a
    random point there, accepted with the cubed cosine of its angle to that ray, is random by solid angle. With
    ``stripes`` its ray is turned into the nearest plane of light. A point is seen where the incidence angle is below
    ``max_incidence`` degrees and nothing is in front of it. Raises StageError where a scanner stands on the surface,
    and where nothing is seen.
    """
    caster = RayCaster(mesh)
    views = [_Projection.build(mesh, faces, position) for position in scanners]
    total = np.array([view.sums[-1] if len(view.sums) else 0.0 for view in views])
    steep = np.cos(np.radians(max_incidence))
    parts: list[tuple[Floats, Ints, Ints, Floats]] = []
    have, tried = 0, 0
    while have < count and total.sum() > 0:
        wanted = int(np.clip(1.2 * (count - have) * (tried / max(have, 1) if have else 2), 1000, 2_000_000))
        for number, size in enumerate(rng.multinomial(wanted, total / total.sum())):
            if not size:
                continue
            points, face, facing = views[number].draw(int(size), rng)
            if stripes is not None:
                points, face, facing = _hit_stripes(mesh, faces, caster, scanners[number], number, stripes, points)
            chosen = facing > steep
            if keep is not None:
                chosen &= rng.random(len(points)) < keep(points)
            points, face, facing = points[chosen], face[chosen], facing[chosen]
            chosen = find_visible(caster, scanners[number], points, face, 1e-5 * mesh.diagonal)
            points, face, facing = points[chosen], face[chosen], facing[chosen]
            parts.append((points, face, np.full(len(points), number), facing))
            have += len(points)
        tried += wanted
        if have < 1e-4 * tried:
            break
    if have < count:
        raise StageError(
            "the virtual scanner sees nothing of the part from `scanners`",
            remedy="move the scanners, raise `max_incidence`, or make `unseen` smaller",
        )
    chosen = rng.permutation(have)[:count]
    points, face, view, facing = (np.concatenate([part[k] for part in parts])[chosen] for k in range(4))
    return Seen(points, face, view, facing, float(np.sqrt(total.sum() * (have / tried) / count)))


def _hit_stripes(
    mesh: Mesh,
    faces: NDArray[np.bool_],
    caster: RayCaster,
    position: Floats,
    number: int,
    stripes: Stripes,
    points: Floats,
) -> tuple[Floats, Ints, Floats]:
    """Where the rays to points (N,3) meet the mesh when they are turned into the planes of light: places (M,3), faces
    (M,) and cosines of incidence (M,)."""
    ray = stripes.move_rays(position, number, points)
    distance, face = caster.find_first(np.broadcast_to(position, ray.shape), ray)
    hit = (face >= 0) & faces[face]
    ray, face = ray[hit], face[hit]
    return position + distance[hit, None] * ray, face, -np.einsum("ij,ij->i", mesh.face_normals[face], ray)


def find_mixed(mesh: Mesh, scanners: Floats, seen: Seen, count: int, rng: np.random.Generator) -> tuple[Floats, Ints]:
    """Mixed pixels (count,3) and their scanners (count,): points at a random depth between foreground and background.

    A ray gives one where a ray beside it, at most one angular step away, hits a surface more than `STEEPEST` steps in
    front or behind. Both are empty where no surface is in front of another.
    """
    caster = RayCaster(mesh)
    origin = scanners[seen.view]
    way = seen.points - origin
    near = np.linalg.norm(way, axis=1)
    way = way / near[:, None]
    found: list[tuple[Ints, Floats]] = []
    for _ in range(8):
        beside = way + seen.step * rng.uniform(-1, 1, way.shape)
        beside = normalise(beside)
        far, _ = caster.find_first(origin, beside)
        jump = np.flatnonzero(np.isfinite(far) & (np.abs(far - near) > STEEPEST * seen.step * near))
        found.append((jump, far[jump]))
    ray, far = (np.concatenate([one[k] for one in found]) for k in range(2))
    if not len(ray):
        return np.empty((0, 3)), np.empty(0, np.int64)
    chosen = rng.permutation(len(ray))[:count] if len(ray) >= count else rng.integers(len(ray), size=count)
    ray, far = ray[chosen], far[chosen]
    depth = near[ray] + rng.random(count) * (far - near[ray])
    return origin[ray] + depth[:, None] * way[ray], seen.view[ray]


@dataclass(frozen=True, eq=False)
class _Projection:
    """The triangles that face a scanner. ``corner`` (K,3,3) projected at distance 1 along the ray to their centre;
    ``face`` (K,) their numbers in the mesh; ``normal`` (K,3) unit; ``height`` (K,): distance of the triangle's plane
    from the scanner; ``sums`` (K,) cumulative areas of the projections."""

    position: Floats
    corner: Floats
    face: Ints
    normal: Floats
    height: Floats
    sums: Floats

    @classmethod
    def build(cls, mesh: Mesh, faces: NDArray[np.bool_], position: Floats) -> _Projection:
        way = mesh.triangles - position
        facing = faces & (np.einsum("ij,ij->i", mesh.cross, way[:, 0]) < 0)
        face = np.flatnonzero(facing)
        corner, face = _divide_wide(way[face], face)
        centre = normalise(corner).sum(axis=1)
        centre = normalise(centre)
        normal = normalise(mesh.cross[face])
        height = np.einsum("ij,ij->i", normal, corner[:, 0])
        corner = corner / np.einsum("ikj,ij->ik", corner, centre)[:, :, None]
        across = cross_corners(corner)
        return cls(position, corner, face, normal, height, np.cumsum(np.linalg.norm(across, axis=1) / 2))

    def draw(self, count: int, rng: np.random.Generator) -> tuple[Floats, Ints, Floats]:
        """At most ``count`` points by solid angle: their places (M,3), faces (M,) and cosines of incidence (M,)."""
        which = np.searchsorted(self.sums, rng.random(count) * self.sums[-1], side="right")
        which = np.minimum(which, len(self.sums) - 1)
        a, b = rng.random((2, count))
        over = a + b > 1
        a, b = np.where(over, 1 - a, a), np.where(over, 1 - b, b)
        first, second, third = np.moveaxis(self.corner[which], 1, 0)
        ray = first + a[:, None] * (second - first) + b[:, None] * (third - first)
        length = np.linalg.norm(ray, axis=1)
        kept = rng.random(count) < length**-3.0
        ray, length, which = ray[kept], length[kept], which[kept]
        along = np.einsum("ij,ij->i", self.normal[which], ray)
        points = self.position + (self.height[which] / along)[:, None] * ray
        return points, self.face[which], -along / length


def _divide_wide(corner: Floats, face: Ints) -> tuple[Floats, Ints]:
    """Triangles (K,3,3) about a scanner at the origin, divided until each is narrow as seen from there."""
    done: list[tuple[Floats, Ints]] = []
    for _ in range(24):
        unit = normalise(corner)
        centre = unit.sum(axis=1)
        centre = normalise(centre)
        wide = np.einsum("ikj,ij->ik", unit, centre).min(axis=1) < WIDEST
        done.append((corner[~wide], face[~wide]))
        if not wide.any():
            return np.concatenate([one[0] for one in done]), np.concatenate([one[1] for one in done])
        a, b, c = np.moveaxis(corner[wide], 1, 0)
        d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corner = np.concatenate([np.stack(one, axis=1) for one in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
        face = np.tile(face[wide], 4)
    raise StageError("a scanner of `scanners` stands on a surface", remedy="move it away from part and surroundings")
