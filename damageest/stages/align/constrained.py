"""Best fit in which only some motions are allowed, and regions count more or less than others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, FiniteFloat, model_validator
from pydantic import Field as Option

from damageest.artefacts import Floats, Part, Pose, Scan
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.geometry.selectors import Selector, StrictMapping
from damageest.geometry.transforms import make_motions, move_points
from damageest.stages.align import Align
from damageest.stages.align.surface.frame import Frame, RigidPose

Axis = Literal["x", "y", "z"]
Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
AXES: tuple[Axis, ...] = ("x", "y", "z")
MOST = 30_000
"""Points that are fitted."""
STILL = 1e-3
"""Movement of the scan by a step, in tolerances, after which the fit ends."""
SHRINK = 0.7
"""By how much the distance at which a point loses its weight shrinks with each step."""
ON_PART = 0.5
"""Share of the points that has to lie within the tolerance of the part, for the pose to be one."""
TOLD = 0.25
"""Movement, in tolerances, by the motions that are not allowed, from which it is told."""


def _check_axes(axes: tuple[Axis, ...]) -> tuple[Axis, ...]:
    if len(set(axes)) < len(axes):
        raise ValueError("each axis once at most")
    return axes


Axes = Annotated[tuple[Axis, ...], AfterValidator(_check_axes)]


class RegionWeight(StrictMapping):
    """The weight of a region of the skin."""

    skin: Selector = Option(description="box, half_space, facing, faces, at, kind: skin of the region")
    weight: float = Option(ge=0, le=1000, description="weight, relative to 1 outside all regions; 0: ignored")


class Constrained(Align):
    """Fits a given pose by the allowed motions alone: shifts along axes of the part, turns about them.

    Points off the surface get less weight with each step, as in `icp`. For parts that a fixture holds in the other
    directions, and for inspection plans that require it.
    """

    renamed: ClassVar[Mapping[str, str]] = {"about": "pivot"}
    use: Literal["constrained"] = "constrained"
    T_part_scan: RigidPose | None = Option(
        None,
        description="initial pose T_part_scan, 4x4, from the scan's frame to the part's, in the job's unit; default: "
        "identity",
    )
    shift: Axes = Option((), description="axes of the part's frame along which the scan may be moved: x, y, z")
    turn: Axes = Option((), description="axes of the part's frame about which it may be turned: x, y, z")
    pivot: Vector | None = Option(
        None, description="point of the turns, in part coordinates, in the job's unit; default: middle of the bounds"
    )
    weights: tuple[RegionWeight, ...] = Option(
        (), description="regions with another weight; the last one that matches applies"
    )
    max_distance: float | None = Option(
        None,
        gt=0,
        description="largest distance of a scan point from the part in the first step, in the job's unit; default: 3 % "
        "of the part's diagonal",
    )
    iterations: int = Option(60, ge=1, description="largest number of steps of the fit")

    @model_validator(mode="after")
    def _check_motions(self) -> Self:
        if not (self.shift or self.turn):
            raise ValueError("no motion is allowed: give shift or turn, as  shift: [z]; or take  use: none")
        return self

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """The fitted pose. Raises StageError where the scan has too few points, the fit does not converge, or the scan
        does not lie on the part in its pose."""
        Frame.build(scan, part)  # which refuses scans of too few points, or of another size
        centre = part.bounds.mean(axis=0) if self.pivot is None else np.array(self.pivot)
        some = scan.points[np.linspace(0, len(scan.points) - 1, min(MOST, len(scan.points))).astype(np.int64)]
        pose = np.eye(4) if self.T_part_scan is None else np.array(self.T_part_scan)
        basis = np.eye(6)[[AXES.index(axis) for axis in self.turn] + [3 + AXES.index(axis) for axis in self.shift]].T
        reach = self.max_distance or 0.03 * part.diagonal
        least = max(3 * scan.noise, tolerance / 2)
        for _ in range(self.iterations):
            at = move_points(some, pose)
            rows, distance, trust = self._measure(at - centre, at, part, reach)
            own = rows @ basis
            twist = basis @ _solve(own, distance, trust)
            pose = _about(twist, centre) @ pose
            moved = float(np.abs(rows @ twist)[trust > 0].max(initial=0.0))
            if moved < STILL * tolerance and reach <= least:
                break
            reach = max(SHRINK * reach, least)
        else:
            raise StageError(
                f"the fit did not converge in {self.iterations} iterations: the last step moved the scan by "
                f"{moved:.3g} {part.unit}",
                "raise iterations, or give a closer T_part_scan",
            )
        at = move_points(some, pose)
        rows, distance, trust = self._measure(at - centre, at, part, reach)
        on = np.abs(distance) <= tolerance
        if on.mean() < ON_PART:
            raise StageError(
                f"with the allowed motions, at best {on.mean():.0%} of the scan lies on the part within the "
                f"tolerance of {tolerance:.4g} {part.unit}",
                "allow more motions, give a closer T_part_scan, or use align: register",
            )
        notes = self._describe(rows, distance, trust, tolerance, part.unit)
        rms = float(np.sqrt((distance[on] ** 2).mean()))
        return Pose(pose, rms, float(on.mean()), notes=notes)

    def _measure(self, lever: Floats, at: Floats, part: Part, reach: float) -> tuple[Floats, Floats, Floats]:
        """How twists change the distance of points (N,6), their signed distance (N,), and their weight (N,)."""
        distance, face = signed_distance(at, part)
        normals = part.face_normals[face]
        rows = np.concatenate([np.cross(lever, normals), normals], axis=1)
        # Geman-McClure: a point as far off as the reach counts a quarter
        trust = 1 / (1 + (distance / reach) ** 2) ** 2
        trust[np.abs(distance) > 3 * reach] = 0
        feet = at - distance[:, None] * normals
        region = np.ones(len(at))
        for one in self.weights:
            region[one.skin.matches(feet, normals, face, part)] = one.weight
        return rows, distance, trust * region

    def _describe(self, rows: Floats, distance: Floats, trust: Floats, tolerance: float, unit: str) -> tuple[str, ...]:
        words = [f"shift {axis}" for axis in self.shift] + [f"turn {axis}" for axis in self.turn]
        told = f"only these motions were fitted: {', '.join(words)}"
        free = _solve(rows, distance, trust)
        moved = float(np.quantile(np.abs(rows @ free)[trust > 0], 0.98)) if (trust > 0).any() else 0.0
        if moved > TOLD * tolerance:
            told += f"; with all motions free the skin would move by up to {moved:.3g} {unit}"
        return (told,)


def _solve(rows: Floats, distance: Floats, trust: Floats) -> Floats:
    """The motion (K,) that brings the distances to 0 by least squares; motions that no point fixes are 0."""
    root = np.sqrt(trust)
    return np.asarray(np.linalg.lstsq(rows * root[:, None], -distance * root, rcond=1e-6)[0])


def _about(twist: Floats, centre: Floats) -> Floats:
    """The motion (4,4) of a twist (6,) about a point (3,)."""
    T = np.array(make_motions(twist[None])[0])
    T[:3, 3] += centre - T[:3, :3] @ centre
    return T
