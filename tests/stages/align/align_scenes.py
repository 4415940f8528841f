"""Scans of damaged parts with known pose."""

from __future__ import annotations

from typing import Any

import numpy as np
from damageest_benchmarks.parts import PARTS
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats, Part, Scan, Truth
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.stages.align.surface.oriented_points import orient_surface
from damageest.stages.align.surface.plane_grid import PartSurface
from damageest.stages.scan.simulate import Simulate


def scene(
    name: str, seed: int, missing: float = 0.0, unseen: float = 0.0, clutter: float = 0.02, points: int = 30_000
) -> tuple[Part, Scan]:
    """A part, and a scan of it in a random pose: a plane in a random direction takes the share ``missing`` of its
    volume, the share ``unseen`` of the surface faces away from the scanner, the share ``clutter`` is spread over the
    bounds. The noise is 0.0005 of the diagonal."""
    import manifold3d

    rng = np.random.default_rng(seed)
    part = PARTS[name]()
    whole = manifold3d.Manifold(manifold3d.Mesh64(part.vertices.copy(), part.faces.astype(np.uint64)))
    solid = whole
    if missing:
        direction = _unit(rng)
        low, high = np.quantile(part.vertices @ direction, [0, 1])
        for _ in range(12):
            level = (low + high) / 2
            solid = whole.trim_by_plane(tuple(-direction), -level)
            low, high = (level, high) if solid.volume() < (1 - missing) * whole.volume() else (low, level)
    mesh = solid.to_mesh64()
    skin = Part(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64))
    cloud = orient_surface(skin, points, rng)
    facing = cloud.normals @ _unit(rng)
    seen = cloud.points[facing >= np.quantile(facing + 1e-6 * rng.random(points), unseen)]
    noise = 0.0005 * part.diagonal
    seen = seen + rng.normal(0, noise, seen.shape)
    size = part.bounds[1] - part.bounds[0]
    dirt = part.bounds[0] - 0.1 * size + rng.random((int(clutter * len(seen)), 3)) * 1.2 * size
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    T[:3, 3] = rng.normal(0, 3 * part.diagonal, 3)
    scan = Scan(rng.permutation(np.concatenate([seen, dirt])), noise=noise, truth=Truth(None, T))
    return part, scan.move(np.linalg.inv(T))


def error(part: Part, T: Floats, scan: Scan) -> float:
    """The error of the pose, modulo symmetries of the part, in standard deviations of the noise: rms distance to the
    part of the part's own surface, moved by the error of the pose."""
    assert scan.truth is not None
    wrong = T @ np.linalg.inv(scan.truth.T_part_scan)
    surface: NDArray[np.float64] = orient_surface(part, 3000, np.random.default_rng(0)).points
    distance = PartSurface(part).closest(surface @ wrong[:3, :3].T + wrong[:3, 3])[0]
    return float(np.sqrt((distance**2).mean())) / scan.noise


def _unit(rng: np.random.Generator) -> Floats:
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def make_plate(scale: float = 1.0) -> Part:
    """A plate, 120 mm long, that a half turn maps onto itself but for one of its four holes, which is larger."""
    import manifold3d

    plate = manifold3d.Manifold.cube((100, 60, 8), True)
    for x, y, radius in ((40, 20, 4.5), (-40, 20, 3.5), (-40, -20, 3.5), (40, -20, 3.5)):
        plate -= manifold3d.Manifold.cylinder(18, radius, radius, 64, True).translate((x, y, 0))
    return _to_part(plate, scale)


def make_bracket() -> Part:
    """An angle with legs of 50 and 54 mm and a hole in each."""
    import manifold3d

    def box(size: tuple[float, ...], at: tuple[float, ...]) -> manifold3d.Manifold:
        return manifold3d.Manifold.cube(size, True).translate(at)

    hole = manifold3d.Manifold.cylinder(12, 4, 4, 64, True)
    body = box((50, 40, 6), (25, 0, 3)) + box((6, 40, 54), (3, 0, 27)) - hole.translate((35, 8, 3))
    return _to_part(body - hole.rotate((0, 90, 0)).translate((3, 8, 36)))


def _to_part(body: Any, scale: float = 1.0) -> Part:
    mesh = body.to_mesh64()
    return Part(scale * np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64))


def watch_by_camera(
    part: Part, seed: int, points: int, wave: float, noise: float = 0.3, step: float = 1.0
) -> tuple[Scan, float]:
    """What a depth camera sees of a part from a random direction, and the tolerance of the scan: depths in steps, with
    noise and a smooth error; the camera is the origin and looks along z. Lengths in mm."""
    rng = np.random.default_rng(seed)
    away = _unit(rng)
    middle = part.bounds.mean(0)
    options = {
        "points": points,
        "noise": noise,
        "waviness": wave,
        "mixed": 0.01,
        "scanners": [(middle + 4 * part.diagonal * away).tolist()],
        "positions_known": False,
        "seed": seed,
    }
    seen = Simulate.model_validate(options).run("mm", part).points
    x = np.cross(away, rng.normal(size=3))
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(away, x), away])
    at = (seen - middle) @ R.T + [5, -7, -4 * part.diagonal]
    at[:, 2] = np.round(at[:, 2] / step) * step
    T = np.eye(4)
    T[:3, :3] = R.T
    T[:3, 3] = middle - R.T @ [5, -7, -4 * part.diagonal]
    spacing = measure_noise_and_spacing(at)[1]
    scan = Scan(at, noise=float(np.hypot(noise, step / np.sqrt(12))), spacing=spacing, truth=Truth(None, T))
    return scan, 1.5 * step


def cut_strip(name: str, seed: int, share: float, scale: float = 1.0, points: int = 12_000) -> tuple[Part, Scan]:
    """A scan of a strip along the longest side of a part: the ``share`` of its skin, seen from one side, in a random
    pose; its lengths times ``scale``. The noise is 0.0005 of the diagonal."""
    rng = np.random.default_rng(seed)
    part = PARTS[name]()
    cloud = orient_surface(part, int(points / share), rng)
    across = np.delete(np.eye(3), int(np.argmax(np.ptp(part.vertices, axis=0))), axis=0)
    angle = rng.random() * np.pi
    u = np.cos(angle) * across[0] + np.sin(angle) * across[1]
    v = (np.cos(angle) * across[1] - np.sin(angle) * across[0]) * rng.choice([-1, 1]) + 0.5 * rng.normal(size=3)
    facing = cloud.normals @ (v / np.linalg.norm(v)) > 0.15
    level = np.quantile(cloud.points[facing] @ u, 0.2 + 0.6 * rng.random())
    chosen = np.argsort(np.abs(cloud.points @ u - level) + np.where(facing, 0, 1e9))[:points]
    noise = 0.0005 * part.diagonal
    seen = (cloud.points[chosen] + rng.normal(0, noise, (points, 3))) * scale
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    T[:3, 3] = rng.normal(0, 3 * part.diagonal, 3)
    return part, Scan(rng.permutation(seen), noise=noise, truth=Truth(None, T)).move(np.linalg.inv(T))


def measure_apart(part: Part, T: Floats, scan: Scan) -> float:
    """How far a pose moves the part's corners from where they are (rms), in diagonals; symmetries are not regarded."""
    assert scan.truth is not None
    D = T @ np.linalg.inv(scan.truth.T_part_scan)
    moved = part.vertices @ D[:3, :3].T + D[:3, 3] - part.vertices
    return float(np.sqrt((moved**2).sum(1).mean())) / part.diagonal
