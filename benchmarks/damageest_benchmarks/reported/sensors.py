"""Scans of a sensor that is wrong, of light that went astray, and of what lies on the part."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise
from damageest_benchmarks.families.scene import Draw
from damageest_benchmarks.reported.bench import Bench, bite, take
from damageest_benchmarks.troubles.parts import make_named_part
from damageest_benchmarks.troubles.scene import evaluate_waves, make_random_waves


def two_lasers_two_sizes() -> Draw:
    """Half of the points, those of one laser, are .8 % larger about the table's axis."""
    bench = take("block", 40)
    points = bench.scan()[0]
    larger = np.arange(len(points)) % 2 == 0
    return bench.finish(points * np.where(larger, 1.008, 1.0)[:, None], rigid=False)


def _turn_about_z(points: Floats, angle: Floats) -> Floats:
    x, y = points[:, 0], points[:, 1]
    cos, sin = np.cos(angle), np.sin(angle)
    return np.column_stack([cos * x - sin * y, sin * x + cos * y, points[:, 2]])


def table_turns_less_than_told() -> Draw:
    """The table turned 2 % less than its steps say: what was seen last lies over what was seen first."""
    bench = take("block", 41)
    points = bench.scan()[0]
    turn = np.arctan2(points[:, 1], points[:, 0]) + np.pi
    return bench.finish(_turn_about_z(points, 0.02 * turn), rigid=False)


def drift_round_the_part() -> Draw:
    """Tracking drifts on the way round: at the end the scan is four tolerances higher than at its beginning."""
    bench = take("block", 42)
    points = bench.scan()[0]
    turn = (np.arctan2(points[:, 1], points[:, 0]) + np.pi) / (2 * np.pi)
    points[:, 2] += 4 * bench.tolerance * turn
    return bench.finish(points, rigid=False)


def planes_as_bowls() -> Draw:
    """Each view bends what is flat: depth is wrong with the square of the distance from the middle of the image."""
    bench = take("block", 43)
    points, view, scanners = bench.look(3, 24_000)
    middle = bench.part.bounds.mean(axis=0)
    ray = normalise(points - scanners[view])
    axis = normalise(middle - scanners)[view]
    off = 1 - np.einsum("ij,ij->i", ray, axis)
    amount = off / np.quantile(off, 0.95) - 0.5
    return bench.finish(points + 3 * bench.tolerance * amount[:, None] * ray, rigid=False)


def mirrored_below_the_floor() -> Draw:
    """A shiny table shows the part again below itself."""
    bench = take("block", 44)
    points, normals = bench.scan(26_000)
    points, normals = points[normals[:, 2] > -0.9], normals[normals[:, 2] > -0.9]
    floor = bench.part.bounds[0, 2]
    again = points[(np.abs(normals[:, 2]) < 0.5) & (bench.rng.random(len(points)) < 0.6)]
    again = bench.blur(again * [1, 1, -1] + [0, 0, 2 * floor], 3)
    return bench.finish(np.concatenate([points, again]))


def _blur_shape(points: Floats, radius: float) -> Floats:
    """Each point moves to the middle of the surface within a radius: edges and corners become round."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    gap, near = tree.query(points, 64, distance_upper_bound=radius)
    weight = np.where(np.isfinite(gap), 1.0, 0.0)
    near = np.where(near < len(points), near, 0)
    return np.asarray((points[near] * weight[..., None]).sum(axis=1) / weight.sum(axis=1)[:, None])


def _move_across(points: Floats, wanted: Floats, normals: Floats) -> Floats:
    """Points moved along their normals only, as far as towards the wanted places."""
    across = np.einsum("ij,ij->i", wanted - points, normals)
    return np.asarray(points + across[:, None] * normals)


def edges_too_shallow() -> Draw:
    """Depth is averaged over a patch, and edges are rounded by up to three tolerances."""
    bench = take("block", 45)
    points, normals = bench.scan(60_000, noise=0.0)
    wanted = _blur_shape(points, 8 * bench.tolerance)
    return bench.finish(bench.blur(_move_across(points, wanted, normals)))


def light_between_walls() -> Draw:
    """Light that two walls reflect fills the inner corners."""
    bench = take("ribbed_plate", 46, (1, 1, 0), 0.06)
    points, normals = bench.scan(60_000, noise=0.0)
    wanted = _blur_shape(points, 10 * bench.tolerance)
    raised = np.einsum("ij,ij->i", wanted - points, normals) > 0.2 * bench.tolerance
    moved = np.where(raised[:, None], _move_across(points, wanted, normals), points)
    return bench.finish(bench.blur(moved))


def spray_layer() -> Draw:
    """Matting spray: half a tolerance everywhere, and up to twice that in patches."""
    bench = take("block", 47)
    points, normals = bench.scan()
    waves, phases = make_random_waves(0.3 * bench.part.diagonal, bench.rng)
    thick = bench.tolerance * (0.5 + 0.5 * np.clip(evaluate_waves(points, waves, phases), 0, 1))
    return bench.finish(points + thick[:, None] * normals)


def markers_on_the_skin() -> Draw:
    """Round markers, 6 mm across and .15 mm thick, are on the part, three of them cut out of the scan."""
    bench = take("block", 48)
    points, normals = bench.scan(30_000)
    places = bench.rng.choice(len(points), 14, replace=False)
    keep = np.ones(len(points), dtype=np.bool_)
    for number, place in enumerate(places):
        below = (np.linalg.norm(points - points[place], axis=1) < 3) & (normals @ normals[place] > 0.99)
        if number < 3:
            keep &= ~below
        points[below] += 0.15 * normals[place]
    return bench.finish(points[keep])


def band_of_reflective_tape() -> Draw:
    """A reflecting band seems to stand four tolerances out of the skin."""
    bench = take("tube", 49, (1, 0, 1), 0.07)
    points, normals = bench.scan(26_000)
    band = (np.abs(points[:, 2] + 20) < 4) & (points[:, 1] > 0) & (np.linalg.norm(points[:, :2], axis=1) > 20)
    return bench.finish(points + np.where(band, 4 * bench.tolerance, 0.0)[:, None] * normals)


def floor_of_the_room() -> Draw:
    """The part stands on a floor that has four times its points."""
    bench = take("block", 50)
    points, normals = bench.scan(18_000)
    points = points[normals[:, 2] > -0.9]
    low = bench.part.bounds[0, 2]
    floor = np.column_stack([bench.rng.uniform(-4, 4, (60_000, 2)) * bench.part.diagonal / 2, np.full(60_000, low)])
    under = (np.abs(floor[:, :2]) < bench.part.bounds[1, :2]).all(axis=1)
    return bench.finish(np.concatenate([points, bench.blur(floor[~under])]))


def old_surface_persists() -> Draw:
    """A filter over time keeps what was there before: beside the pit, a third of the old skin's points."""
    part = make_named_part("cuboid", 0.0)
    bench = bite(part, 51, (10.0, 5.0, 17.0), 8.0)
    points = bench.scan()[0]
    old = bench.scan(7000, part)[0]
    return bench.finish(np.concatenate([points, old]))


def wedge_with_a_chip() -> Draw:
    """At an edge of 20 degrees the nearest face tells the wrong side."""
    from manifold3d import CrossSection, Manifold

    from damageest.artefacts import Mesh
    from damageest.geometry.solids import to_arrays
    from damageest_benchmarks.families.scene import to_part

    section = CrossSection([np.array([(0.0, 0.0), (60.0, -10.6), (60.0, 10.6)])])
    body = Manifold.extrude(section, 50) + Manifold.cube((12, 30, 20)).translate((55, -15, 0))
    part = to_part(Mesh(*to_arrays(body)), "wedge")
    bench: Bench = bite(part, 52, (2.0, 0.0, 30.0), 7.0)
    return bench.finish(bench.scan()[0])
