"""Random damages of the kinds that parts come back with, repeatable from a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part, Solid
from damageest.errors import StageError
from damageest.evaluate.scores import depth, surface_points
from damageest.geometry.solids import to_manifold
from damageest.stages.scan.scanner import apply_tools
from damageest.stages.scan.tools import BlobTool, BoxTool, CylinderTool, PlaneTool, SphereTool, Tool

SHARE = (0.002, 0.33)
"""Least and largest share of the part's volume that a damage takes."""


class DamagePlace:
    """A part with what the kinds of damage ask of it; all figures are shares of its ``size``, the diagonal."""

    def __init__(self, part: Part, rng: np.random.Generator) -> None:
        self.part, self.rng, self.size = part, rng, part.diagonal
        self.points, self.normals = surface_points(part, 3000)

    def pick(self, allowed: Any = None) -> tuple[Floats, Floats]:
        """A random point on the surface and the outward normal there, of those ``allowed`` (N,)."""
        numbers = np.arange(len(self.points)) if allowed is None else np.flatnonzero(allowed)
        if not len(numbers):
            raise LookupError("the part has no such place")
        k = self.rng.choice(numbers)
        return self.points[k], self.normals[k]

    def uniform(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def seed(self) -> int:
        return int(self.rng.integers(1 << 30))

    def turn(self) -> tuple[float, float, float]:
        a, b, c = self.rng.uniform(0, 360, 3)
        return float(a), float(b), float(c)

    @cached_property
    def edges(self) -> tuple[Floats, Floats]:
        """Points (M,3) on convex edges sharper than 40 degrees, and the directions (M,3) that bisect them outward."""
        import trimesh

        mesh = trimesh.Trimesh(self.part.vertices, self.part.faces, process=False)
        sharp = (mesh.face_adjacency_angles > np.radians(40)) & mesh.face_adjacency_convex
        ends = mesh.vertices[mesh.face_adjacency_edges[sharp]]
        out = mesh.face_normals[mesh.face_adjacency[sharp]].sum(1)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        rng = np.random.default_rng(5)
        k = rng.choice(len(length), 600, p=length / length.sum())
        points = ends[k, 0] + rng.random((600, 1)) * (ends[k, 1] - ends[k, 0])
        return np.asarray(points), np.asarray(out[k] / np.linalg.norm(out[k], axis=1, keepdims=True))

    def edge(self) -> tuple[Floats, Floats]:
        k = self.rng.integers(len(self.edges[0]))
        return self.edges[0][k], self.edges[1][k]

    def _reach(self, sign: float) -> Floats:
        """(N,) from each surface point along its normal (sign 1) or against it (-1) to the next surface."""
        origin = self.part.bounds.mean(0)
        body = to_manifold(self.part, origin)
        start = self.points - origin + sign * 1e-6 * self.size * self.normals
        stop = start + sign * 0.4 * self.size * self.normals
        hits = [body.ray_cast(tuple(a), tuple(b)) for a, b in zip(start, stop, strict=True)]
        return np.array([0.4 * self.size * min((h.distance for h in hit), default=9.0) for hit in hits])

    @cached_property
    def thickness(self) -> Floats:
        return self._reach(-1)

    @cached_property
    def gap(self) -> Floats:
        return self._reach(1)


def _tuple(point: Floats) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z


def _lump(site: DamagePlace, centre: Floats, radius: float) -> Tool:
    if site.rng.random() < 0.3:
        return SphereTool(centre=_tuple(centre), radius=radius)
    return BlobTool(centre=_tuple(centre), radius=radius, seed=site.seed())


def chip(site: DamagePlace) -> list[Tool]:
    """A chip off an edge or corner: a lump, or a rough break across it."""
    point, out = site.edge()
    if site.rng.random() < 0.6:
        return [_lump(site, point, site.size * site.uniform(0.04, 0.13))]
    tilt = out + 0.25 * site.rng.normal(size=3)
    tilt /= np.linalg.norm(tilt)
    depth, within = site.size * site.uniform(0.015, 0.05), site.size * site.uniform(0.08, 0.2)
    rough = site.size * site.uniform(0.0005, 0.003)
    return [
        PlaneTool(
            point=_tuple(point - depth * tilt), normal=_tuple(tilt), within=within, roughness=rough, seed=site.seed()
        )
    ]


def pit(site: DamagePlace) -> list[Tool]:
    """A pit in a face, deeper than a quarter of its width."""
    point, normal = site.pick()
    radius = site.size * site.uniform(0.04, 0.12)
    return [_lump(site, point + site.uniform(-0.1, 0.5) * radius * normal, radius)]


def cut(site: DamagePlace) -> list[Tool]:
    """A box or a wedge taken out of an edge or a face."""
    point = (site.edge() if site.rng.random() < 0.7 else site.pick())[0]
    a, b, c = site.size * site.rng.uniform(0.06, 0.22, 3)
    rough = site.size * site.uniform(0.0005, 0.002) if site.rng.random() < 0.4 else 0.0
    return [
        BoxTool(
            centre=_tuple(point),
            size=(float(a), float(b), float(c)),
            rotation=site.turn() if site.rng.random() < 0.6 else (0.0, 0.0, 0.0),
            roughness=rough,
            seed=site.seed(),
        )
    ]


def end(site: DamagePlace) -> list[Tool]:
    """An end broken off, 5 to 30 % of the volume."""
    origin = site.part.bounds.mean(0)
    body = to_manifold(site.part, origin)
    if site.rng.random() < 0.6:
        normal = site.rng.choice([-1.0, 1.0]) * np.eye(3)[site.rng.integers(3)] + 0.15 * site.rng.normal(size=3)
    else:
        normal = site.rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    wanted = site.uniform(0.05, 0.3) * site.part.volume
    low, high = -site.size, site.size
    for _ in range(40):
        offset = (low + high) / 2
        taken = body.trim_by_plane(_tuple(normal), offset).volume()
        low, high = (offset, high) if taken > wanted else (low, offset)
    rough = site.size * site.uniform(0, 0.004)
    return [PlaneTool(point=_tuple(origin + offset * normal), normal=_tuple(normal), roughness=rough, seed=site.seed())]


def hole(site: DamagePlace) -> list[Tool]:
    """A round hole through all that lies behind a point, more or less square to the surface."""
    point, normal = site.pick()
    axis = -normal + 0.15 * site.rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    radius = site.size * site.uniform(0.025, 0.06)
    back = 0.05 * site.size
    return [CylinderTool(point=_tuple(point - back * axis), axis=_tuple(axis), radius=radius, length=3 * site.size)]


def worn_through(site: DamagePlace) -> list[Tool]:
    """A thin wall worn through by something round, so that the loss has two rims."""
    wall = site.thickness
    place = np.flatnonzero(wall < 0.12 * site.size)
    if not len(place):
        raise LookupError("the part has no thin wall")
    k = site.rng.choice(place)
    radius = max(wall[k], 0.02 * site.size) * site.uniform(1.1, 2.0)
    middle = site.points[k] + (radius - 1.25 * wall[k]) * site.normals[k] * site.uniform(0.0, 0.8)
    return [_lump(site, middle, float(radius))]


def groove(site: DamagePlace) -> list[Tool]:
    """A long, narrow groove scored into a face, open at its ends or not."""
    point, normal = site.pick()
    along = np.cross(normal, site.rng.normal(size=3))
    along /= np.linalg.norm(along)
    depth, width = site.size * site.uniform(0.015, 0.05), site.size * site.uniform(0.02, 0.06)
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(np.column_stack([along, np.cross(normal, along), normal])).as_euler("xyz", degrees=True)
    size = (site.size * site.uniform(0.25, 0.7), width, 2 * depth)
    return [BoxTool(centre=_tuple(point), size=size, rotation=_tuple(turn))]


def beside_gap(site: DamagePlace) -> list[Tool]:
    """A lump out of a wall that faces another one closely: in a bore, between teeth, in a slot."""
    point, normal = site.pick(site.gap < 0.15 * site.size)
    radius = site.size * site.uniform(0.04, 0.1)
    return [_lump(site, point - site.uniform(0.0, 0.5) * radius * normal, radius)]


def touching(site: DamagePlace) -> list[Tool]:
    """Two lumps whose rims meet or overlap, or that a thin web of sound surface parts."""
    point, normal = site.edge() if site.rng.random() < 0.3 else site.pick()
    radii = site.size * site.rng.uniform(0.04, 0.09, 2)
    apart = radii.sum() * site.uniform(0.75, 1.05)
    off = site.points - point
    level = np.abs(np.linalg.norm(off, axis=1) - apart)
    other = site.rng.choice(np.argsort(level, kind="stable")[:40])
    first = point - site.uniform(-0.3, 0.3) * radii[0] * normal
    second = site.points[other] - site.uniform(-0.3, 0.3) * radii[1] * site.normals[other]
    return [_lump(site, first, float(radii[0])), _lump(site, second, float(radii[1]))]


KINDS: dict[str, Callable[[DamagePlace], list[Tool]]] = {
    make.__name__: make for make in (chip, pit, cut, end, hole, worn_through, groove, beside_gap, touching)
}
"""Name to maker of one random loss."""


@dataclass(frozen=True, eq=False)
class Damaged:
    """``tools`` for the stage `scan: simulate`, the ``kinds`` they were made as, and the true ``damage``."""

    tools: tuple[Tool, ...]
    kinds: tuple[str, ...]
    damage: Solid


def random_damage(part: Part, seed: int, kinds: tuple[str, ...] = (), losses: int | None = None) -> Damaged:
    """One to three losses on a part, each at least 0.008 of the diagonal deep and together within ``SHARE``.

    ``kinds``: of the first losses, the rest at random; a kind the part has no place for is replaced by another.
    """
    rng = np.random.default_rng([6173, seed])
    site = DamagePlace(part, rng)
    wanted = losses or max(len(kinds), int(rng.choice([1, 2, 3], p=[0.6, 0.25, 0.15])))
    tools: list[Tool] = []
    made: list[str] = []
    damage: Solid | None = None
    for number in range(wanted):
        name = kinds[number] if number < len(kinds) else str(rng.choice(list(KINDS)))
        for attempt in range(60):
            if attempt and attempt % 20 == 0:
                name = str(rng.choice(list(KINDS)))
            found = _try(site, name, tools)
            if found is not None:
                tools, damage = found
                made.append(name)
                break
    if damage is None:
        raise LookupError(f"no damage fits the part with seed {seed}")
    return Damaged(tuple(tools), tuple(made), damage)


def _try(site: DamagePlace, name: str, before: list[Tool]) -> tuple[list[Tool], Solid] | None:
    """The tools with one more loss, and the damage of all; None where it does not suit."""
    part = site.part
    try:
        more = KINDS[name](site)
        alone = apply_tools(part, more)[1]
        if alone is None or not SHARE[0] * part.volume < alone.volume < SHARE[1] * part.volume:
            return None
        if depth(alone, part) < 0.008 * part.diagonal:
            return None
        tools = [*before, *more]
        damage = apply_tools(part, tools)[1] if before else alone
    except (StageError, LookupError):
        return None
    return None if damage is None or damage.volume > SHARE[1] * part.volume else (tools, damage)
