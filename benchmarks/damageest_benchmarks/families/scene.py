"""What a draw of a family is: a part, a scan, and what is true of both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Pose, Scan, Solid
from damageest.geometry.transforms import invert_pose


@dataclass(frozen=True, eq=False)
class Draw:
    """One draw. ``damage``: the true one in the part's frame; ``pose`` (4,4) T_part_scan, None where none is right.

    ``depth``: the true depth in mm, NaN where it is not known. ``shown``: whether the scanner saw the damage with its
    rim as a whole, so that a result is wanted. ``settings`` of the job; ``said``: what was drawn, for the table.
    ``rigid``: whether one pose is right for the whole scan; where it is not, the found one is judged by the damage.
    """

    part: Part
    scan: Scan
    damage: Solid | None
    pose: Floats | None
    tolerance: float
    depth: float = float("nan")
    shown: bool = True
    settings: tuple[str, ...] = ()
    said: Mapping[str, str | float] = field(default_factory=dict)
    rigid: bool = True


def draw_motion(rng: np.random.Generator, size: float) -> Floats:
    """A random motion (4,4), by up to two sizes."""
    from scipy.spatial.transform import Rotation

    motion = np.eye(4)
    motion[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    motion[:3, 3] = rng.uniform(-2, 2, 3) * size
    return motion


def move_out(scan: Scan, motion: Floats) -> tuple[Scan, Floats]:
    """The scan in another frame, and T_part_scan (4,4) from there."""
    return scan.move(motion), invert_pose(Pose(motion))


def to_part(mesh: Mesh, name: str) -> Part:
    """The mesh as a part in mm."""
    return Part(mesh.vertices, mesh.faces, unit="mm", path=name)
