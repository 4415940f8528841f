"""A virtual scan of a virtually damaged part, for jobs whose true result is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from pydantic import types as kinds

from damageest.artefacts import Floats, Ints, Mesh, Part, Scan, Truth
from damageest.geometry.units import canonical_unit
from damageest.stages.scan import ReadScan, _errors
from damageest.stages.scan._draw import Draw, Drawing, UnseenRegion, draw_points
from damageest.stages.scan._random_field import choose_patches
from damageest.stages.scan._scene import DetachedPiece, Scene, Table, build_scene
from damageest.stages.scan.deformation import Deformation, deform, deform_solid
from damageest.stages.scan.tools import AnyTool, RigidMatrix, SolidTool, Vector


class Simulate(ReadScan):
    """A virtual scanner: removes damage from the part with tools, then draws points on the rest.

    The scan's `truth` holds the true damage, added metal and pose. Lengths are in the job's unit, tools and scanners in
    the part's frame. With `scanners`, points are only where a straight line from a scanner reaches the surface. Without
    them, surface that the part itself would hide has points too; exclude such regions with `unseen`.
    """

    use: Literal["simulate"] = "simulate"
    damage: tuple[AnyTool, ...] = Field(
        (), description="tools, each of which removes material; none: an undamaged part"
    )
    added: tuple[SolidTool, ...] = Field(
        (), description="tools, each of which adds material to the part: a weld bead, spatter"
    )
    detached: tuple[DetachedPiece, ...] = Field((), description="pieces of the part that are moved, not removed")
    surroundings: tuple[SolidTool, ...] = Field(
        (), description="tools that are bodies beside the part, such as a fixture: scanned with it, and they hide it"
    )
    deform: Deformation | None = Field(
        None, description="deformation of the damaged part before the scan; default: none"
    )
    table: Table | None = Field(None, description="a plane plate that the part stands on; default: none")
    points: kinds.PositiveInt = Field(150_000, description="number of points, outliers included")
    scanners: Annotated[int, Field(ge=1, le=1000)] | Annotated[tuple[Vector, ...], Field(min_length=1)] | None = Field(
        None,
        description="scanner positions, in the part's frame: a list of [x, y, z], or a number of positions spread "
        "evenly around the part at 3 of its diagonals; default: no scanner, points on all of the surface",
    )
    max_incidence: float = Field(
        80.0,
        gt=0,
        le=90,
        description="with `scanners`: no points where the angle between ray and surface normal is larger, in degrees",
    )
    positions_known: bool = Field(True, description="whether the scan holds its scanner positions")
    noise: float | None = Field(
        None,
        ge=0,
        description="standard deviation of the noise along each axis, in the job's unit; default: 0.0005 of the part's "
        "diagonal",
    )
    noise_along: Literal["axes", "ray"] = Field(
        "axes", description="`ray`: noise only along the ray from the scanner; without `scanners` along the normal"
    )
    noise_growth: float = Field(
        0.0,
        ge=0,
        le=4,
        description="with `scanners`: power of the distance with which `noise` grows; 2: triangulation and stereo",
    )
    noise_slant: float = Field(
        0.0,
        ge=0,
        le=4,
        description="with `scanners`: power of 1 / cosine of the angle between ray and normal with which `noise` grows",
    )
    reference_distance: kinds.PositiveFloat | None = Field(
        None,
        description="distance from the scanner at which `noise` and `depth_step` hold where they grow, in the job's "
        "unit; default: that of the part's middle",
    )
    waviness: float = Field(
        0.0,
        ge=0,
        description="standard deviation of a smooth error along the ray, in the job's unit, different in each view; "
        "without `scanners` along the surface normal",
    )
    wavelength: kinds.PositiveFloat | None = Field(
        None, description="wavelength of `waviness`, in the job's unit; default: a fifth of the part's diagonal"
    )
    waviness_shared: bool = Field(False, description="whether `waviness` is the same in all views")
    depth_step: float = Field(
        0.0,
        ge=0,
        description="step to which the distance from the scanner is rounded, in the job's unit; without `scanners`: "
        "of the z coordinate in the scanner's frame; 0: no rounding",
    )
    depth_growth: float = Field(
        0.0,
        ge=0,
        le=4,
        description="with `scanners`: power of the distance with which `depth_step` grows; 2: a stereo camera, whose "
        "step is z² times the step of its disparity over focal length and baseline",
    )
    stripes: float = Field(
        0.0,
        ge=0,
        description="with `scanners`: distance between the lines of a laser-line scanner at the part's middle, in the "
        "job's unit: all points lie on them; 0: no lines",
    )
    mixed: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="with `scanners`: share of points that are mixed pixels, between foreground and background at the "
        "edge of a surface that is in front of another",
    )
    sheets: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="share of the skin, in patches, where every second point lies on a second sheet `sheet_offset` off",
    )
    sheet_offset: float = Field(
        0.0,
        description="distance of the sheets of `sheets` from the skin, towards the scanner, in the job's unit; "
        "without `scanners` outward; below 0: behind the skin",
        allow_inf_nan=False,
    )
    patches: float = Field(0.0, ge=0, lt=1, description="share of the skin, in patches, without points (no texture)")
    patch_size: kinds.PositiveFloat | None = Field(
        None,
        description="size of the patches of `patches` and `sheets`, about, in the job's unit; default: a tenth of "
        "the part's diagonal",
    )
    misplaced: float = Field(
        0.0,
        ge=0,
        description="error of registration of the views, in the job's unit: each view after the first is shifted by "
        "this length and turned by about as much at the part's ends",
    )
    scale: kinds.PositiveFloat = Field(
        1.0, description="factor on all lengths of the scan, such as 1.002 for a wrong scale bar"
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

    @model_validator(mode="after")
    def _check_scanners(self) -> Self:
        if self.scanners is None:
            for name in ("mixed", "misplaced", "stripes", "noise_growth", "noise_slant", "depth_growth"):
                if getattr(self, name):
                    raise ValueError(f"{name}: needs `scanners`")
        for name, other in (("sheets", "sheet_offset"), ("depth_growth", "depth_step")):
            if getattr(self, name) and not getattr(self, other):
                raise ValueError(f"{name}: needs `{other}`")
        if self.deform and (self.surroundings or self.table):
            raise ValueError("deform: is not possible with surroundings or a table, which would be deformed as well")
        if (
            self.scanners is not None
            and self.misplaced
            and (self.scanners if isinstance(self.scanners, int) else len(self.scanners)) < 2
        ):
            raise ValueError("misplaced: needs at least 2 positions in `scanners`; the first view is not moved")
        return self

    def run(self, unit: str, part: Part) -> Scan:
        """The scan in the scanner's frame. Raises StageError for a tool that misses the part or is not a solid, and
        where nothing is left of the part or to be seen."""
        rng = np.random.default_rng([4409, self.seed])
        pose = self._choose_pose(part, rng)
        scene = build_scene(part, self.damage, self.added, self.detached, self.surroundings, self.table)
        sigma = 0.0005 * part.diagonal if self.noise is None else self.noise
        outlier_count = round(self.outliers * self.points)
        draw = self._draw(scene, part, self.points - outlier_count, rng)
        if self.deform:
            draw = replace(draw, points=deform(draw.points, self.deform, part))
        points, view, scanners = self._add_errors(draw, part, scene.body, sigma, rng)
        if outlier_count:
            margin = 0.1 * (part.bounds[1] - part.bounds[0])
            outliers = rng.uniform(part.bounds[0] - margin, part.bounds[1] + margin, (outlier_count, 3))
            order = rng.permutation(self.points)
            points = np.concatenate([points, outliers])[order]
            view = np.concatenate([view, rng.integers(max(1, len(scanners)), size=outlier_count)])[order]
        inverse = np.eye(4)
        inverse[:3, :3] = pose[:3, :3].T
        # a scan of another scale is right where the part's middle is
        inverse[:3, 3] = -self.scale * pose[:3, :3].T @ pose[:3, 3] - (self.scale - 1) * part.bounds.mean(axis=0)
        if not np.array_equal(pose, np.eye(4)):
            points, scanners = (at @ pose[:3, :3].T + pose[:3, 3] for at in (points, scanners))
        if self.depth_step and self.scanners is None:
            points = points.copy()
            points[:, 2] = self.depth_step * np.round(points[:, 2] / self.depth_step)
        if self.scale != 1:
            points, scanners = self.scale * points, self.scale * scanners
        notes = (f"simulated: damage tools: {len(self.damage)}, noise {sigma:.4g} {canonical_unit(unit)}", *scene.notes)
        known = self.scanners is not None and self.positions_known
        lost = deform_solid(scene.damage, self.deform, part) if self.deform and scene.damage else None
        return Scan(
            points,
            None,
            canonical_unit(unit),
            truth=Truth(scene.damage, inverse, scene.added, lost),
            notes=(*notes, *draw.notes),
            viewpoints=scanners if known else None,
            view=view.astype(np.int32) if known else None,
        )

    def _draw(self, scene: Scene, part: Part, count: int, rng: np.random.Generator) -> Draw:
        """Points without errors, in the part's frame."""
        how = Drawing(
            scanners=self.scanners if isinstance(self.scanners, int | None) else np.array(self.scanners, np.float64),
            max_incidence=self.max_incidence,
            unseen=self.unseen,
            density=self.density,
            patches=self.patches,
            patch_size=self.patch_size or part.diagonal / 10,
            stripes=self.stripes,
            mixed=round(self.mixed * self.points),
            seed=self.seed,
        )
        return draw_points(scene, part, how, count, rng)

    def _add_errors(
        self, draw: Draw, part: Part, body: Mesh, sigma: float, rng: np.random.Generator
    ) -> tuple[Floats, Ints, Floats]:
        """Points, view and scanners with the errors that do not depend on the scanner's frame."""
        points, view, scanners = draw.points, draw.view, draw.scanners
        if self.waviness:
            wavelength = self.wavelength or part.diagonal / 5
            field = np.zeros_like(view) if self.waviness_shared else view
            points = _errors.add_waviness(points, draw.toward, field, self.waviness, wavelength, self.seed)
        if self.sheets:
            doubled = choose_patches(body, self.sheets, self.patch_size or part.diagonal / 10, self.seed + 900_001)
            points = _errors.add_sheet(points, draw.toward, doubled(draw.points), self.sheet_offset, rng)
        reach = np.empty(0)
        spread: Floats | float = sigma
        if len(scanners):
            middle = np.linalg.norm(scanners - part.bounds.mean(axis=0), axis=1)[view]
            reach = np.full(len(view), self.reference_distance) if self.reference_distance else middle
            if self.noise_growth or self.noise_slant:
                share = np.linalg.norm(draw.points - scanners[view], axis=1) / reach
                spread = _errors.grow(sigma, share, self.noise_growth, draw.facing, self.noise_slant)
        if sigma:
            points = _errors.add_noise(points, spread, draw.toward if self.noise_along == "ray" else None, rng)
        if self.depth_step and len(scanners):
            points = _errors.quantise_depth(points, scanners[view], self.depth_step, self.depth_growth, reach)
        if self.misplaced:
            centre = part.bounds.mean(axis=0)
            points, scanners = _errors.misplace_views(
                points, view, scanners, centre, part.diagonal / 2, self.misplaced, rng
            )
        return points, view, scanners

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
