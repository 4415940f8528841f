"""Round parts whose angle one small feature tells: turned, prismatic and screw-like ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Mesh, Scan
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_arrays, to_solid
from damageest_benchmarks.families.scene import Draw, draw_motion, move_out, to_part

POINTS = 40_000
NOISE = 0.0003
"""As a share of the diagonal; the tolerance is four of them."""
FEATURES = ("keyway", "flat", "hole", "lug")


def _turn(rng: np.random.Generator) -> Any:
    """A shaft of three or four steps."""
    from manifold3d import CrossSection, Manifold

    radii, lengths = rng.uniform(10, 20, int(rng.integers(3, 5))), rng.uniform(10, 20, 4)
    z, outline = 0.0, [(0.0, 0.0)]
    for radius, length in zip(radii, lengths, strict=False):
        outline += [(radius, z), (radius, z + length)]
        z += length
    return Manifold.revolve(CrossSection([[*outline, (0.0, z)]]), 180)


def _make_prism(rng: np.random.Generator) -> Any:
    from manifold3d import Manifold

    return Manifold.cylinder(rng.uniform(25, 50), 18, 18, int(rng.integers(5, 9))) + Manifold.cylinder(8, 22, 22, 120)


def _make_screw(rng: np.random.Generator) -> Any:
    from manifold3d import CrossSection, Manifold

    lobes, angles = int(rng.integers(2, 5)), np.linspace(0, 2 * np.pi, 120, endpoint=False)
    radius = 15 + 2.0 * np.cos(lobes * angles)
    section = CrossSection([np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])])
    body = Manifold.extrude(section, 45, 60, rng.uniform(60, 150))
    return body + Manifold.cylinder(10, 20, 20, 120).translate((0, 0, -9))


BODIES: Mapping[str, Callable[[np.random.Generator], Any]] = {
    "turned": _turn,
    "prism": _make_prism,
    "screw": _make_screw,
}


def _make_feature(kind: str, body: Any, share: float, rng: np.random.Generator) -> tuple[Any, Any]:
    """What is added and what is cut, for a feature on about a ``share`` of the skin."""
    from manifold3d import Manifold

    low = np.array(body.bounding_box()).reshape(2, 3)
    middle, edge = low.mean(axis=0), float(np.sqrt(share * body.surface_area()))
    z = middle[2] + rng.uniform(-0.2, 0.2) * (low[1, 2] - low[0, 2])
    skin = float(np.abs(np.array(body.slice(z).to_polygons()[0])).max())
    if kind == "keyway":
        return None, Manifold.cube((edge, 0.5 * edge, 1.4 * edge), True).translate((skin, 0, z))
    if kind == "flat":
        return None, Manifold.cube((40, 80, 1.2 * edge), True).translate((skin + 20 - 0.1 * edge, 0, z))
    if kind == "hole":
        return None, Manifold.cylinder(2 * edge, 0.35 * edge, 0.35 * edge, 48, True).rotate((0, 90, 0)).translate(
            (skin, 0, z)
        )
    return Manifold.cube((edge, 0.5 * edge, edge), True).translate((skin, 0, z)), None


def draw_turned(seed: int) -> Draw:
    """A draw of the family. ``shown``: the feature was seen. Where it was not, points near it are left out."""
    from manifold3d import Manifold

    rng = np.random.default_rng([8103, seed])
    name, kind = list(BODIES)[seed % 3], FEATURES[seed // 3 % 4]
    share = float(np.exp(rng.uniform(np.log(0.003), np.log(0.05))))
    damaged, seen = bool(rng.random() < 0.5), bool(rng.random() < 0.75)
    plain = BODIES[name](rng)
    added, cut = _make_feature(kind, plain, share, rng)
    body = plain + added if added is not None else plain - cut
    part = to_part(Mesh(*to_arrays(body)), name)
    left, damage = body, None
    if damaged:
        far = part.vertices[part.vertices[:, 0] < 0.2 * part.bounds[0, 0]]
        cutter = Manifold.sphere(rng.uniform(0.06, 0.1) * part.diagonal, 64).translate(far[int(rng.integers(len(far)))])
        left, damage = body - cutter, to_solid(body ^ cutter, np.zeros(3))
    noise = NOISE * part.diagonal
    points = sample_by_area(Mesh(*to_arrays(left)), POINTS, rng)[0]
    if not seen:
        points = points[~_is_of_feature(points, plain, body, noise)]
    scan = Scan(points + rng.normal(scale=noise, size=points.shape), unit="mm")
    scan, pose = move_out(scan, draw_motion(rng, part.diagonal))
    said: dict[str, str | float] = {"body": name, "feature": kind, "share": share, "damaged": damaged, "seen": seen}
    return Draw(part, scan, damage, pose, 4 * noise, shown=seen, said=said)


def _is_of_feature(points: Floats, plain: Any, body: Any, noise: float) -> Flags:
    """Whether each point is nearer than six noises to what the feature adds or takes away."""
    changed = Mesh(*to_arrays((plain - body) + (body - plain)))
    return np.asarray(distance_to_mesh(points, changed) < 6 * noise)
