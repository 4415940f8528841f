"""Scans of damaged parts with known pose."""

from __future__ import annotations

import numpy as np
from damageest_evaluate.parts import PARTS
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats, Part, Scan, Truth
from damageest.stages.align._field import PartSurface
from damageest.stages.align._points import orient_surface


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
