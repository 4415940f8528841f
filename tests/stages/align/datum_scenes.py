"""Parts and scans whose datums are known: what each datum fixes, and wear everywhere but on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from damageest_benchmarks.parts import PARTS
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats, Ints, Part, Pose, Scan
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.shapes import recognise_shape
from damageest.geometry.solids import to_arrays
from damageest.stages.align.datum.system import DatumSystem, split_faces
from damageest.stages.align.icp import Icp

NOISE = 2e-4
"""Of the diagonal; the tolerance is four times as large."""


@dataclass(frozen=True)
class Scene:
    part: Part
    scan: Scan
    tolerance: float

    def align(self, datum: Any, shift: float = 1.0) -> Pose:
        """The pose from a start that is about a tolerance and a tenth of a degree off."""
        start = np.eye(4)
        start[:3, :3] = Rotation.from_rotvec([0.1, -0.1, 0.1], degrees=True).as_matrix()
        start[:3, 3] = shift * self.tolerance * np.array([0.5, -0.6, -0.6])
        return Icp.model_validate({"T_part_scan": start.tolist(), "datum": datum}).run(
            self.scan, self.part, self.tolerance
        )


def scan_part(part: Part, depth: Floats | float = 0.0, points: int = 6000, seed: int = 0) -> Scene:
    """A scan in the part's frame. ``depth`` (F,): how deep each triangle is worn, in tolerances."""
    rng = np.random.default_rng(seed)
    noise = NOISE * part.diagonal
    at, face = sample_by_area(part, points, rng)
    worn = np.broadcast_to(depth, len(part.faces))[face] * 4 * noise
    at = at - worn[:, None] * part.face_normals[face] + rng.normal(scale=noise, size=at.shape)
    return Scene(part, Scan(at, noise=noise), 4 * noise)


def make_knob() -> Part:
    """A body of revolution about z: a cylinder from z = -20 to 0, a cone up to 10, and a ball on it."""
    from manifold3d import CrossSection, Manifold

    angle = np.linspace(-np.arccos(5 / 8), np.pi / 2, 40)
    ball = np.column_stack([8 * np.cos(angle), 8 * np.sin(angle) + 10 + np.sqrt(39)])
    profile = np.concatenate([[[0, -20], [10, -20], [10, 0], [5, 10]], ball[1:-1], [[0, ball[-1, 1]]]])
    body = Manifold.revolve(CrossSection([profile]), 128)
    vertices, faces = to_arrays(body)
    return Part(vertices, faces)


def make_flange() -> Part:
    """A plate of 80 x 50 x 10 mm about the origin with bores of 12 mm at x = -25 and 25, y = 10."""
    from manifold3d import Manifold

    body = Manifold.cube((80, 50, 10), True)
    for x in (-25, 25):
        body -= Manifold.cylinder(20, 6, 6, 96, True).translate((x, 10, 0))
    vertices, faces = to_arrays(body)
    return Part(vertices, faces)


def make_mushroom() -> Part:
    """A stem of 20 x 20 mm from z = -30 to 0 under a plate of 40 x 40 x 10 mm."""
    from manifold3d import Manifold

    body = Manifold.cube((20, 20, 40), True).translate((0, 0, -10)) + Manifold.cube((40, 40, 10), True).translate(
        (0, 0, 5)
    )
    vertices, faces = to_arrays(body)
    return Part(vertices, faces)


def number_faces(part: Part) -> Part:
    """The part with its smooth pieces as CAD faces."""
    number = np.zeros(len(part.faces), np.int64)
    pieces = split_faces(part, np.arange(len(part.faces)))
    for k, piece in enumerate(pieces):
        number[piece] = k
    return replace(part, faces_brep=number, face_kinds=("other",) * len(pieces))


def choose_datums(part: Part, first: int) -> dict[str, list[int]]:
    """Of the large faces with a shape, the number ``first`` by area as A, and those that then fix most."""
    assert part.faces_brep is not None
    area = np.bincount(part.faces_brep, np.linalg.norm(part.cross, axis=1))
    shaped = [
        int(k) for k in np.argsort(-area)
        if area[k] > 0.01 * area.sum() and recognise_shape(part.triangles[part.faces_brep == k]) is not None
    ][:14]  # fmt: skip
    features = {k: DatumSystem.find(part, {"A": (k,)}).features[0] for k in shaped}
    free, chosen = np.eye(6), {}
    for letter in "ABC":
        candidates = [shaped[first]] if letter == "A" else shaped
        best = max(candidates, key=lambda k: features[k].divide(free)[0].shape[1])
        taken, left = features[best].divide(free)
        if not taken.shape[1]:
            break
        chosen[letter], free = [best], left
    return chosen


def make_worn(name: str, first: int, points: int = 60_000) -> tuple[Scene, dict[str, list[int]]]:
    """A part with each face worn by 1 to 4 tolerances but for its datums, and these."""
    part = number_faces(PARTS[name]())
    datums = choose_datums(part, first)
    assert part.faces_brep is not None
    depth = np.random.default_rng(first).uniform(1, 4, int(part.faces_brep.max()) + 1)
    depth[[face for faces in datums.values() for face in faces]] = 0
    numbers: Ints = part.faces_brep
    return scan_part(part, depth[numbers], points, first), datums
