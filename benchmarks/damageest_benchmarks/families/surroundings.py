"""Two scans of a part with the table and the fixtures around it, between which the part was moved or laid down another
way: what stays is not what decides the pose."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Scan
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_arrays, to_solid
from damageest.geometry.transforms import move_points
from damageest.io.meshes import write_points
from damageest_benchmarks.families.scene import Draw, draw_motion, move_out

POINTS = 40_000
"""Points on the part; what is around it has as many for its area."""
NOISE, TOLERANCE = 0.0006, 8
"""Noise as a share of the diagonal, and the tolerance in noises: edges of an earlier scan are rounded by about half of
its spacing."""
WAYS = ("as before", "slid and turned", "on its back", "on its side")
"""How the part lies in the later scan. What is around it stays."""
AROUND = ("table", "table and blocks")
DOWN = -0.9
"""A face whose normal points down more than that lies on the table, and was not seen."""


def _make_body(rng: np.random.Generator) -> tuple[Any, Floats]:
    """A bracket with a boss, a step and a lug on its side, and the extent (3,) of its base, which begins at the
    origin."""
    from manifold3d import Manifold

    length, width, height = rng.uniform((55, 35, 18), (80, 50, 28))
    step = Manifold.cube((0.35 * length, width + 2, 0.5 * height)).translate((0.65 * length + 1, -1, 0.5 * height + 1))
    radius = rng.uniform(4, 7)
    place = rng.uniform((0.15 * length, 0.25 * width), (0.4 * length, 0.6 * width))
    boss = Manifold.cylinder(rng.uniform(8, 14), radius, radius, 64).translate((*place, height - 1))
    lug = Manifold.cube((8, 7, 0.4 * height)).translate((rng.uniform(0.05, 0.5) * length, width - 1, 0.2 * height))
    return Manifold.cube((length, width, height)) - step + boss + lug, np.array([length, width, height])


def _lay(body: Any, way: str, rng: np.random.Generator) -> Floats:
    """The motion (4,4) that lays a body on the table z = 0 this way, slid and turned about the vertical."""
    from scipy.spatial.transform import Rotation

    over = {"on its back": (180, 0), "on its side": (90, 0)}.get(way, (0, 0))
    turn = rng.uniform(20, 340)
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler("xyz", [*over, turn], degrees=True).as_matrix()
    at = move_points(to_arrays(body)[0], motion)
    motion[:3, 3] = [*(rng.uniform(-8, 8, 2) - (at.min(axis=0) + at.max(axis=0))[:2] / 2), -at[:, 2].min()]
    return motion


def _scan(body: Any, motion: Floats, blocks: Any, dense: float, noise: float, rng: np.random.Generator) -> Scan:
    """The part as it lies on the table, with what is around it, from all sides but below."""
    lying = Mesh(*to_arrays(body.transform(motion[:3].tolist())))
    reach = 0.8 * float(np.linalg.norm(np.ptp(lying.vertices, axis=0)))
    found = [_see(lying, dense, rng)]
    low, high = lying.bounds[:, :2] - [[3.0], [-3.0]]
    count = int(dense * 4 * reach**2)
    flat = np.column_stack([rng.uniform(-reach, reach, (count, 2)), np.zeros(count)])
    flat = flat[~((flat[:, :2] > low) & (flat[:, :2] < high)).all(axis=1)]
    found.append((flat, np.tile([0.0, 0.0, 1.0], (len(flat), 1))))
    if not blocks.is_empty():
        found.append(_see(Mesh(*to_arrays(blocks)), dense, rng))
    points, normals = (np.concatenate(each) for each in zip(*found, strict=True))
    return Scan(points + rng.normal(scale=noise, size=points.shape), normals=normals, unit="mm")


def _see(mesh: Mesh, dense: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Points on all faces but those below, and their normals."""
    points, face = sample_by_area(mesh, int(dense * mesh.area), rng)[:2]
    normals = mesh.face_normals[face]
    return points[normals[:, 2] > DOWN], normals[normals[:, 2] > DOWN]


def _read_as_part(scan: Scan) -> Part:
    """What `part: earlier_scan` makes of a scan."""
    from damageest.stages.part.earlier_scan import EarlierScan

    assert scan.normals is not None
    with tempfile.TemporaryDirectory(prefix="damageest-family-") as folder:
        path = Path(folder) / "earlier.ply"
        names = ("x", "y", "z", "nx", "ny", "nz")
        write_points(path, dict(zip(names, np.column_stack([scan.points, scan.normals]).T, strict=True)))
        return EarlierScan.model_validate({"path": path}).run("mm")


def draw_surroundings(seed: int) -> Draw:
    """A draw of the family, its truth in the frame of the earlier scan. The chip is on an upright edge, which both
    scans show."""
    from manifold3d import Manifold

    rng = np.random.default_rng([8105, seed])
    way, around = WAYS[seed % 4], AROUND[seed // 4 % 2]
    body, size = _make_body(rng)
    diagonal = float(np.linalg.norm(size))
    noise, dense = NOISE * diagonal, POINTS / Mesh(*to_arrays(body)).area
    chip = Manifold.sphere(rng.uniform(0.05, 0.08) * diagonal, 64).translate((0, 0, 0.5 * size[2]))
    left = body - chip
    blocks = Manifold()
    if around != "table":
        beside = 0.6 * diagonal
        blocks = Manifold.cube((16, 22, 30)).translate((beside, -9, 0)) + Manifold.cube((30, 12, 18)).translate(
            (-beside - 20, 12, 0)
        )
    before = _lay(body, "as before", rng)
    after = before if way == "as before" else _lay(body, way, rng)
    earlier = _scan(body, before, blocks, dense, noise, rng)
    later = _scan(left, after, blocks, dense, noise, rng)
    damage = to_solid((body - left).transform(before[:3].tolist()), np.zeros(3))
    scan, pose = move_out(later, draw_motion(rng, diagonal))
    to_earlier = before @ np.linalg.inv(after)
    said: dict[str, str | float] = {"way": way, "around": around, "tolerance": TOLERANCE * noise}
    return Draw(_read_as_part(earlier), scan, damage, to_earlier @ pose, TOLERANCE * noise, said=said)
