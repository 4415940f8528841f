"""The other hand: scans of the part as drawn and of its mirror image, damaged or not, whole or in part."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Mesh, Scan
from damageest.geometry.solids import to_arrays, to_solid
from damageest_benchmarks.families.scene import Draw, draw_motion, move_out, to_part
from damageest_benchmarks.troubles.views import place_scanners, scan_surface

POINTS = 30_000
NOISE = 0.0003
"""As a share of the diagonal; the tolerance is four of them."""
_MIRROR = np.diag([-1.0, 1.0, 1.0])


def _box(x: float, y: float, z: float, at: tuple[float, float, float]) -> Any:
    from manifold3d import Manifold

    return Manifold.cube((x, y, z), True).translate(at)


def _hole(radius: float, x: float, y: float) -> Any:
    from manifold3d import Manifold

    return Manifold.cylinder(80, radius, radius, 48, True).translate((x, y, 0))


def _make_nearly_symmetric(rng: np.random.Generator) -> Any:
    """A plate with a boss and four holes, of which one is elsewhere, and a lower step along one long side."""
    x, y, off = rng.uniform(50, 80), rng.uniform(30, 45), rng.uniform(2.5, 6)
    body = _box(x, y, 10, (0, 0, 0)) + _box(x / 3, y / 2, 8, (0, 0, 8)) - _box(x + 1, 6, 6, (0, -y / 2, 5))
    for a, b in ((-1, -1), (1, -1), (-1, 1), (1, 1)):
        body -= _hole(3, a * (x / 2 - 7) - (off if (a, b) == (1, 1) else 0), b * (y / 2 - 7.5))
    return body


def _make_bracket(rng: np.random.Generator) -> Any:
    x, y = rng.uniform(50, 70), rng.uniform(30, 45)
    body = _box(x, y, 8, (0, 0, 0)) + _box(8, y, 40, (-x / 2 + 4, 0, 16)) - _hole(4, x / 4, y / 5)
    body += _box(x / 2, 6, 14, (0, -y / 2 + 3, 7))
    return body - _box(20, 12, 12, (-x / 2, y / 2, 34))


def _make_lever(rng: np.random.Generator) -> Any:
    from manifold3d import Manifold

    length, bend = rng.uniform(50, 70), rng.uniform(15, 35)
    arm = _box(length, 12, 8, (length / 2, 0, 0))
    second = arm.rotate((0, 0, bend)).translate((length, 0, rng.uniform(3, 6)))
    ends = Manifold.cylinder(14, 10, 10, 64, True) + Manifold.cylinder(20, 8, 8, 64, True).translate((length, 0, 2))
    return arm + second + ends - _hole(4, 0, 0) - _hole(3, length, 0)


def _make_steps(rng: np.random.Generator) -> Any:
    sizes = rng.uniform(12, 26, (4, 3))
    body = _box(60, 40, 12, (0, 0, 0))
    for (a, b), size in zip(((-1, -1), (1, -1), (-1, 1), (1, 1)), sizes, strict=True):
        body += _box(size[0], size[1], size[2], (a * 14, b * 8, size[2] / 2))
    return body


BODIES = {
    "nearly symmetric": _make_nearly_symmetric,
    "bracket": _make_bracket,
    "lever": _make_lever,
    "steps": _make_steps,
}


def draw_hand(seed: int) -> Draw:
    """A draw of the family: ``pose`` is None where the scan is of the mirror image. ``shown``: the scan is whole."""
    from manifold3d import Manifold

    rng = np.random.default_rng([8102, seed])
    name = list(BODIES)[seed % len(BODIES)]
    mirrored, damaged, whole = bool(seed // 4 % 2), bool(rng.random() < 0.5), bool(rng.random() < 0.6)
    body = BODIES[name](rng)
    part = to_part(Mesh(*to_arrays(body)), name)
    left, damage = body, None
    if damaged:
        corner = part.vertices[int(rng.integers(len(part.vertices)))]
        cutter = Manifold.sphere(rng.uniform(0.06, 0.1) * part.diagonal, 64).translate(corner)
        left, damage = body - cutter, to_solid(body ^ cutter, np.zeros(3))
    mesh = Mesh(*to_arrays(left))
    scanners = place_scanners(part, 8 if whole else 2, rng)
    points, _ = scan_surface(mesh, scanners, POINTS, rng)
    noise = NOISE * part.diagonal
    points = points + rng.normal(scale=noise, size=points.shape)
    scan, pose = move_out(Scan(points @ _MIRROR if mirrored else points, unit="mm"), draw_motion(rng, part.diagonal))
    said: dict[str, str | float] = {"body": name, "hand": "mirrored" if mirrored else "proper", "damaged": damaged}
    said |= {"scan": "whole" if whole else "in part"}
    return Draw(part, scan, None if mirrored else damage, None if mirrored else pose, 4 * noise, shown=whole, said=said)
