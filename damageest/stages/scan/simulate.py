"""A virtual scan of a virtually damaged part, for jobs whose true result is known."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from pydantic import types as kinds

from damageest.artefacts import Floats, Part, Scan, Solid, Truth
from damageest.geometry.units import canonical_unit
from damageest.stages.scan import ReadScan, _random_field
from damageest.stages.scan.scanner import apply_tools, sample_seen
from damageest.stages.scan.tools import AnyTool, Direction, RigidMatrix, Vector


class UnseenRegion(BaseModel):
    """A region of the surface that the virtual scanner does not see."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    direction: Direction = Field(description="direction in the part's frame; its length does not matter")
    angle: float = Field(
        60.0,
        gt=0,
        le=180,
        description="no points where the angle between outward normal and `direction` is smaller than this, in degrees",
    )
    beyond: Vector | None = Field(
        None,
        description="instead of `angle`: no points beyond the plane through this point with `direction` as its normal",
    )


class Simulate(ReadScan):
    """A virtual scanner: removes damage from the part with tools, then draws points on what is left.

    The scan's `truth` holds the true damage and pose. Lengths are in the job's unit, tools in the part's frame. Surface
    that the part itself would hide from a scanner has points too; exclude such regions with `unseen`.
    """

    use: Literal["simulate"] = "simulate"
    damage: tuple[AnyTool, ...] = Field(
        (), description="tools, each of which removes material; none: an undamaged part"
    )
    points: kinds.PositiveInt = Field(150_000, description="number of points, outliers included")
    noise: float | None = Field(
        None,
        ge=0,
        description="standard deviation of the noise along each axis, in the job's unit; default: 0.0005 of the part's "
        "diagonal",
    )
    outliers: float = Field(
        0.0, ge=0, lt=1, description="share of points placed at random in the part's bounding box, enlarged by a fifth"
    )
    density: float = Field(
        0.0, ge=0, le=1.5, description="standard deviation of the logarithm of the density of points; 0: even density"
    )
    unseen: tuple[UnseenRegion, ...] = Field((), description="directions or half-spaces without points")
    pose: Literal["identity", "random"] | Annotated[RigidMatrix, Field(description="4x4, rigid")] = Field(
        "identity", description="pose of the part in the scanner's frame: identity, random, or a 4x4 matrix"
    )
    seed: int = Field(0, ge=0, description="seed of all random draws, except the shapes of the tools")

    def run(self, unit: str, part: Part) -> Scan:
        """The scan in the scanner's frame. Raises StageError for a tool that misses the part or is not a solid, and
        where nothing is left of the part or to be seen."""
        rng = np.random.default_rng([4409, self.seed])
        pose = self._choose_pose(part, rng)
        left, damage, notes = apply_tools(part, self.damage)
        sigma = 0.0005 * part.diagonal if self.noise is None else self.noise
        outlier_count = round(self.outliers * self.points)
        points = self._sample_seen(left, self.points - outlier_count, part.diagonal, rng)
        points += rng.normal(scale=sigma, size=points.shape) if sigma else 0.0
        if outlier_count:
            margin = 0.1 * (part.bounds[1] - part.bounds[0])
            outliers = rng.uniform(part.bounds[0] - margin, part.bounds[1] + margin, (outlier_count, 3))
            points = np.concatenate([points, outliers])[rng.permutation(self.points)]
        inverse = np.eye(4)
        inverse[:3, :3] = pose[:3, :3].T
        inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
        if not np.array_equal(pose, np.eye(4)):
            points = points @ pose[:3, :3].T + pose[:3, 3]
        notes = (f"simulated: damage tools: {len(self.damage)}, noise {sigma:.4g} {canonical_unit(unit)}", *notes)
        return Scan(points, None, canonical_unit(unit), truth=Truth(damage, inverse), notes=notes)

    def _sample_seen(self, left: Solid, count: int, diagonal: float, rng: np.random.Generator) -> Floats:
        normal = left.cross / np.maximum(np.linalg.norm(left.cross, axis=1), 1e-300)[:, None]
        faces = np.ones(len(left.faces), dtype=bool)
        planes = []
        for item in self.unseen:
            toward = np.array(item.direction) / np.linalg.norm(item.direction)
            if item.beyond is None:
                faces &= normal @ toward < np.cos(np.radians(item.angle))
            else:
                planes.append((toward, float(toward @ item.beyond)))
        field = _random_field.RandomField.build(diagonal / 2, 1, self.seed, waves=8)

        def weigh(points: Floats) -> Floats:
            weights = np.exp(self.density * field.evaluate(points)) if self.density else np.ones(len(points))
            for toward, height in planes:
                weights[points @ toward > height] = 0
            return weights

        uneven = bool(self.density or planes)
        return sample_seen(left, faces, count, rng, weigh if uneven else None, 2.5 if self.density else 1.0)

    def _choose_pose(self, part: Part, rng: np.random.Generator) -> Floats:
        if self.pose == "identity":
            return np.eye(4)
        if self.pose != "random":
            return np.array(self.pose, dtype=np.float64)
        from scipy.spatial.transform import Rotation

        pose = np.eye(4)
        pose[:3, :3] = Rotation.random(random_state=rng).as_matrix()
        pose[:3, 3] = rng.uniform(-2, 2, 3) * part.diagonal
        return pose
