"""Scans that a program made a surface of: filled, smoothed, doubled, capped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, Mesh, Scan
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.loops import trace_loops
from damageest.geometry.rays import RayCaster
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.geometry.vectors import normalise
from damageest_benchmarks.families.scene import Draw
from damageest_benchmarks.reported.bench import Bench, bite, refine, take
from damageest_benchmarks.troubles.parts import PLATE_TOLERANCE, make_named_part, make_wall_plate
from damageest_benchmarks.troubles.views import find_visible


def second_layer() -> Draw:
    """Fusion of depths leaves a second surface inside, where the weights end."""
    bench = take("block", 20)
    points, normals = bench.scan(24_000)
    inner = np.arange(len(points)) % 2 == 0
    return bench.finish(points - np.where(inner, 5 * bench.tolerance, 0.0)[:, None] * normals)


def smoothed_until_it_shrank() -> Draw:
    """Twelve rounds of Laplacian smoothing on a mesh scan."""
    import trimesh

    bench = take("block", 21)
    fine = refine(bench.left, 0.012 * bench.part.diagonal)
    mesh = trimesh.Trimesh(bench.blur(fine.vertices), fine.faces, process=False)
    trimesh.smoothing.filter_laplacian(mesh, lamb=0.5, iterations=12)
    return bench.finish_mesh(Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces)))


def _close(bench: Bench, points: Floats, centre: Floats, axis: int, radius: float, ends: tuple[float, float]) -> Floats:
    """Points with the walls of a bore taken away, and a flat skin without noise over each end."""
    flat = [k for k in range(3) if k != axis]
    out = np.linalg.norm(points[:, flat] - centre[flat], axis=1)
    margin = 0.3 * bench.tolerance
    inside = (out < radius + 3 * bench.tolerance) & (points[:, axis] > min(ends) + margin)
    inside &= points[:, axis] < max(ends) - margin
    count = int(0.6 * radius**2 * np.pi)
    discs = []
    for end in ends:
        turn, reach = bench.rng.uniform(0, 2 * np.pi, count), radius * np.sqrt(bench.rng.random(count))
        disc = np.empty((count, 3))
        disc[:, axis] = end
        disc[:, flat] = centre[flat] + reach[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
        discs.append(disc)
    return np.concatenate([points[~inside], *discs])


def bore_closed_by_software() -> Draw:
    """A bore that belongs to the part was filled as a hole of the scan."""
    bench = take("ribbed_plate", 22, (-1, -1, 0), 0.06)
    points = bench.scan(30_000)[0]
    return bench.finish(_close(bench, points, np.array([28.0, -6.0, 0.0]), 2, 6.0, (-5.0, 16.0)))


def balloon_over_what_was_not_seen() -> Draw:
    """Reconstruction from two views closes the rest by a smooth bulge outside the part."""
    bench = take("block", 23)
    points, _, scanners = bench.look(3, 16_000)
    from scipy.spatial import cKDTree

    trial, face = sample_by_area(bench.left, 9000, bench.rng)
    seen = find_visible(RayCaster(bench.left), bench.left, trial, bench.left.face_normals[face], scanners).any(axis=1)
    hidden = trial[~seen]
    gap = np.asarray(cKDTree(trial[seen]).query(hidden)[0])
    away = normalise(bench.part.bounds.mean(axis=0) - scanners.mean(axis=0))
    return bench.finish(np.concatenate([points, hidden + 0.5 * gap[:, None] * away]))


def _crop(bench: Bench, level: float, capped: bool) -> Draw:
    """What is below a level of z, with a flat cap or open."""
    mesh = Mesh(*to_arrays(to_manifold(bench.left).trim_by_plane((0, 0, -1), -level)))
    points = sample_by_area(mesh, 22_000, bench.rng)[0]
    cap = points[:, 2] > level - 1e-6
    body = bench.blur(points[~cap])
    return bench.finish(np.concatenate([body, points[cap]]) if capped else body)


def cropped_and_capped() -> Draw:
    """One end was cut away from the scan, and the cut was closed."""
    return _crop(take("keyed_shaft", 24, (1, 0, -1), 0.05), 46.0, capped=True)


def cropped() -> Draw:
    """One end was cut away from the scan."""
    return _crop(take("keyed_shaft", 25, (1, 0, -1), 0.05), 46.0, capped=False)


def vertices_without_faces() -> Draw:
    """A mesh with vertices on a lattice that no face uses."""
    bench = take("block", 26)
    fine = refine(bench.left, 0.012 * bench.part.diagonal)
    low, high = bench.part.bounds
    more = np.stack(np.meshgrid(*(np.linspace(low[k], high[k], 12) for k in range(3))), axis=-1).reshape(-1, 3)
    return bench.finish_mesh(Mesh(np.concatenate([bench.blur(fine.vertices), more]), fine.faces))


def staircase_of_labels() -> Draw:
    """The surface of voxels that are metal or air: steps of two tolerances on every slope."""
    bench = take("block", 27)
    size = 2 * bench.tolerance
    points, normals = bench.scan(40_000, noise=0.0)
    draw = bench.finish(points, normals)
    assert draw.scan.normals is not None
    along = np.abs(draw.scan.normals).argmax(axis=1)
    at, row = draw.scan.points.copy(), np.arange(len(points))
    at[row, along] = np.round(at[row, along] / size) * size
    return replace(draw, scan=Scan(at, unit="mm"))


def wrong_distance_of_slices() -> Draw:
    """The slices lie 2 % farther apart than the file says: one axis is stretched."""
    bench = take("block", 28)
    return bench.finish(bench.scan()[0], after=lambda at: at * np.array([1.0, 1.0, 1.02]), rigid=False)


def window_closed_by_a_web() -> Draw:
    """Bars that stand close were joined by a web of material that is not there."""
    bench = take("grille", 29, (1, 1, 1), 0.06)
    points = bench.scan(36_000)[0]
    low, high = np.array([-24.0, -17.0]), np.array([-15.0, -8.33])
    within = ((points[:, :2] > low - 0.4) & (points[:, :2] < high + 0.4)).all(axis=1) & (np.abs(points[:, 2]) < 5.8)
    webs = [np.column_stack([bench.rng.uniform(low, high, (240, 2)), np.full(240, z)]) for z in (-6.0, 6.0)]
    return bench.finish(np.concatenate([points[~within], *webs]))


def pit_under_a_lid() -> Draw:
    """A program that fills holes closed the pit, which has no points, by long flat triangles."""
    part = make_named_part("cuboid", 0.0)
    bench = bite(part, 30, (10.0, 5.0, 17.0), 8.0)
    fine = refine(bench.left, 0.012 * part.diagonal)
    middle = fine.triangles.mean(axis=1)
    faces = fine.faces[distance_to_mesh(middle, part) < 1e-3 * part.diagonal]
    (rim,) = trace_loops(faces)
    corners = rim[::-1]
    lid = np.column_stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]])
    used, number = np.unique(np.concatenate([faces, lid]), return_inverse=True)
    return bench.finish_mesh(Mesh(bench.blur(fine.vertices[used]), number.reshape(-1, 3)))


def both_sides_crossed() -> Draw:
    """Two sides of a thin wall were put together so that the front lies behind the back."""
    part = make_wall_plate(5.0)
    bench = bite(part, 31, (-32.0, 2.0, 15.0), 7.0)
    points, view, _ = bench.look(2, 24_000, np.array([[20.0, 250.0, 60.0], [-20.0, -250.0, 60.0]]))
    shift = np.array([0.0, -7 * PLATE_TOLERANCE, 0.0])
    return bench.finish(points + np.where(view == 0, 1.0, 0.0)[:, None] * shift)


def plate_too_thin() -> Draw:
    """Top and bottom of a plate were registered by their edges alone: it is .4 mm too thin."""
    part = make_named_part("plate", 0.0)
    bench = bite(part, 32, part.vertices[np.argmax(part.vertices @ np.array([1.0, 1.0, 1.0]))], 8.0)
    above, below = np.array([30.0, 40.0, 250.0]), np.array([-30.0, -40.0, -250.0])
    points, view, _ = bench.look(2, 24_000, np.stack([above, below]))
    return bench.finish(points + np.where(view == 1, 0.4, 0.0)[:, None] * np.array([0.0, 0.0, 1.0]))
