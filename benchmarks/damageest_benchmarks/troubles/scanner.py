"""Troubles of the scanner: what it does not see, and how its points deviate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.vectors import normalise
from damageest_benchmarks.troubles.lost import bite_wall, lose_rib
from damageest_benchmarks.troubles.scene import Scanning, TroubleScene, evaluate_waves, make_random_waves


def scan_intact(case: Scanning) -> TroubleScene:
    """An undamaged part, seen from the scanner positions."""
    return case.scan(case.part, None)


def scan_in_steps(case: Scanning) -> TroubleScene:
    """An undamaged part; depths come in steps of ``amount`` mm, and the tolerance is auto."""
    scene = case.scan(case.part, None, noise=0)
    assert scene.scanners is not None
    assert scene.view is not None
    start = scene.scanners[scene.view]
    way = scene.points - start
    depth = np.linalg.norm(way, axis=1, keepdims=True)
    points = start + way / depth * np.round(depth / case.amount) * case.amount
    return replace(scene, points=points, settings=("tolerance=auto",))


def misplace_view(case: Scanning) -> TroubleScene:
    """The second view is ``amount`` tolerances away from where it belongs; the part is undamaged."""
    scene = case.scan(case.part, None)
    assert scene.view is not None
    direction = case.make_rng(6).normal(size=3)
    direction *= case.amount * case.tolerance / np.linalg.norm(direction)
    moved = (scene.view == 1)[:, None]
    assert scene.scanners is not None
    scanners = scene.scanners + direction * (np.arange(len(scene.scanners)) == 1)[:, None]
    return replace(scene, points=scene.points + moved * direction, scanners=scanners)


def make_wavy(case: Scanning) -> TroubleScene:
    """An undamaged part; neighbouring points deviate together, by up to ``amount`` tolerances."""
    scene = case.scan(case.part, None)
    waves, phases = make_random_waves(case.part.diagonal / 6, case.make_rng(7))
    height = case.amount * case.tolerance * evaluate_waves(scene.points, waves, phases)
    return scene.with_points(scene.points + height[:, None] * find_normals(case, scene.points))


def make_hollow(case: Scanning) -> TroubleScene:
    """As `make_wavy`, with waves that only go inward; what lies outside is on the skin."""
    scene = case.scan(case.part, None, noise=0)
    waves, phases = make_random_waves(case.part.diagonal / 6, case.make_rng(7))
    height = case.amount * case.tolerance * np.minimum(evaluate_waves(scene.points, waves, phases), 0)
    noise = case.make_rng(12).normal(scale=case.noise, size=scene.points.shape)
    return scene.with_points(scene.points + height[:, None] * find_normals(case, scene.points) + noise)


def lay_sheets(case: Scanning) -> TroubleScene:
    """The second view is ``amount`` tolerances too deep, away from its scanner; the part is undamaged."""
    scene = case.scan(case.part, None)
    assert scene.view is not None
    assert scene.scanners is not None
    way = case.part.bounds.mean(axis=0) - scene.scanners[1]
    deeper = case.amount * case.tolerance * way / np.linalg.norm(way)
    return scene.with_points(scene.points + (scene.view == 1)[:, None] * deeper)


def find_normals(case: Scanning, points: Floats) -> Floats:
    """The outward unit normal (N,3) of the face of the part that is nearest to each point."""
    cross = case.part.cross[closest_on_mesh(points, case.part)[1]]
    return normalise(cross)


def mix_pixels(case: Scanning) -> TroubleScene:
    """Points between front and background where the part's outline hides the background: a sheet behind each edge.

    ``amount``: their share of the scan. The part has an ordinary damage.
    """
    scene = case.scan(*case.damage("chip"))
    assert scene.scanners is not None
    assert scene.view is not None
    normals = find_normals(case, scene.points)
    way = scene.points - scene.scanners[scene.view]
    way = normalise(way)
    # where the ray that passes a little above the skin does not meet the part soon, there is an edge
    beside = (
        scene.points + 0.01 * case.part.diagonal * normals + 0.004 * case.part.diagonal * _turn_across(way, normals)
    )
    distance = RayCaster(case.part).find_first(beside - 0.02 * case.part.diagonal * way, way)[0]
    edge = np.flatnonzero(distance > 0.08 * case.part.diagonal)
    rng = case.make_rng(8)
    chosen = rng.choice(edge, min(len(edge), int(case.amount * len(scene.points))), replace=False)
    points = scene.points.copy()
    points[chosen] += (rng.uniform(0, 0.06, len(chosen)) * case.part.diagonal)[:, None] * way[chosen]
    return scene.with_points(points)


def _turn_across(way: Floats, normals: Floats) -> Floats:
    """The part of the normals across the rays, as unit vectors (N,3)."""
    across = normals - np.einsum("ij,ij->i", normals, way)[:, None] * way
    return normalise(across, 1e-12)


def add_outliers(case: Scanning) -> TroubleScene:
    """Random points in the part's bounding box and around it. ``amount``: their share. With an ordinary damage."""
    scene = case.scan(*case.damage("pit"))
    rng = case.make_rng(9)
    low, high = case.part.bounds
    margin = 0.1 * (high - low)
    stray = rng.uniform(low - margin, high + margin, (int(case.amount * len(scene.points)), 3))
    return scene.with_points(np.concatenate([scene.points, stray]))


def vary_density(case: Scanning) -> TroubleScene:
    """The density of points varies by the factor ``amount``. With an ordinary damage."""
    dense = replace(case, points=3 * case.points).scan(*case.damage("cut"))
    waves, phases = make_random_waves(case.part.diagonal / 2, case.make_rng(10))
    weight = case.amount ** (0.5 * evaluate_waves(dense.points, waves, phases))
    rng = case.make_rng(11)
    kept = np.sort(np.argsort(rng.exponential(size=len(weight)) / weight)[: case.points])
    view = None if dense.view is None else dense.view[kept]
    return replace(dense, points=dense.points[kept], view=view)


def scan_sparsely(case: Scanning) -> TroubleScene:
    """Only ``amount`` points. With an ordinary damage."""
    return replace(case, points=int(case.amount)).scan(*case.damage("pit"))


def make_noisier(case: Scanning) -> TroubleScene:
    """The noise is ``amount`` times what the job's tolerance was made for. With an ordinary damage."""
    left, damage = case.damage("chip")
    return case.scan(left, damage, noise=case.amount)


def widen_tolerance(case: Scanning) -> TroubleScene:
    """The job's tolerance is ``amount`` mm: too large for the part's walls. With a bite out of a wall."""
    thick = replace(case, amount=12.0)
    scene = bite_wall(thick) if case.name == "wall_plate" else lose_rib(case)
    return replace(scene, settings=(f"tolerance={case.amount}",))
