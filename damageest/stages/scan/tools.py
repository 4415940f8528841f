"""Tools of the virtual scanner: solids in the part's frame and the job's unit, which remove or add material."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, FiniteFloat, PositiveFloat

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise
from damageest.options import Options
from damageest.stages import JobPath
from damageest.stages.scan import _random_field

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
MatrixRow = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
Matrix = tuple[MatrixRow, MatrixRow, MatrixRow, MatrixRow]


def _check_not_zero(value: Vector) -> Vector:
    if math.hypot(*value) < 1e-12:
        raise ValueError("a direction must have a length")
    return value


Direction = Annotated[Vector, AfterValidator(_check_not_zero)]


def _check_rigid(value: Matrix) -> Matrix:
    T = np.array(value)
    turn = T[:3, :3]
    if not (np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0):
        raise ValueError("not rigid: its upper left 3x3 must be a rotation, without scale or reflection")
    if not np.allclose(T[3], (0, 0, 0, 1), atol=1e-9):
        raise ValueError("not rigid: its last row must be 0, 0, 0, 1")
    return value


RigidMatrix = Annotated[Matrix, AfterValidator(_check_rigid)]
Seed = Annotated[int, Field(ge=0, description="seed of the random shape; the same seed gives the same shape")]


class Tool(Options, ABC):
    """Base of the tools."""

    model_config = ConfigDict(defer_build=True)
    tool: str

    @abstractmethod
    def build(self, origin: Floats, diagonal: float) -> Any:
        """The tool as a ``manifold3d.Manifold``, coordinates relative to ``origin`` (3,); the part lies within
        ``diagonal`` of it. Raises ValueError for a tool that encloses no volume."""


class SphereTool(Tool):
    """A sphere."""

    tool: Literal["sphere"] = "sphere"
    centre: Vector = Field(description="centre, in the part's frame")
    radius: PositiveFloat = Field(description="radius, in the job's unit")

    def build(self, origin: Floats, diagonal: float) -> Any:
        from manifold3d import Manifold

        ball = Manifold.sphere(self.radius, _count_segments(self.radius, diagonal))
        return ball.translate(tuple(self.centre - origin))


class BoxTool(Tool):
    """A box, rotated about its centre; with ``roughness`` its faces are like fracture surfaces."""

    tool: Literal["box"] = "box"
    centre: Vector = Field(description="centre, in the part's frame")
    size: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = Field(
        description="lengths of the edges, in the job's unit"
    )
    rotation: Vector = Field((0.0, 0.0, 0.0), description="rotation in degrees about the fixed x, then y, then z axis")
    roughness: float = Field(0.0, ge=0, description="rms height of the roughness of the faces, in the job's unit")
    seed: Seed = 0

    def build(self, origin: Floats, diagonal: float) -> Any:
        from manifold3d import Manifold

        block = Manifold.cube(self.size, True)
        if self.roughness:
            wave = max(min(self.size), 12 * self.roughness)
            block = block.refine_to_length(wave / 10)
            fields = [_random_field.RandomField.build(wave, 2, 3 * self.seed + axis) for axis in range(3)]

            # each coordinate is displaced by a field with a slope below 1, so that faces cannot cross
            def displace(points: Floats) -> Floats:
                return points + self.roughness * np.column_stack([field.evaluate(points) for field in fields])

            block = block.warp_batch(displace)
        return block.rotate(self.rotation).translate(tuple(self.centre - origin))


class CylinderTool(Tool):
    """A round bar from a point along an axis; for bores and through holes."""

    tool: Literal["cylinder"] = "cylinder"
    point: Vector = Field(description="centre of one end, in the part's frame")
    axis: Direction = Field(description="direction from that end to the other; its length does not matter")
    radius: PositiveFloat = Field(description="radius, in the job's unit")
    length: PositiveFloat = Field(description="length, in the job's unit")

    def build(self, origin: Floats, diagonal: float) -> Any:
        from manifold3d import Manifold

        bar = Manifold.cylinder(self.length, self.radius, self.radius, _count_segments(self.radius, diagonal))
        return _place(bar, self.axis, self.point - origin)


class PlaneTool(Tool):
    """The space on the side of a plane to which its normal points; with ``roughness`` a fracture instead of a cut."""

    tool: Literal["plane"] = "plane"
    point: Vector = Field(description="a point on the plane, in the part's frame")
    normal: Direction = Field(description="direction to the material that is removed; its length does not matter")
    within: PositiveFloat | None = Field(
        None,
        description="remove only what is within this distance of the line through `point` along `normal`; default: all",
    )
    roughness: float = Field(0.0, ge=0, description="rms height of the roughness of the fracture, in the job's unit")
    grain: PositiveFloat | None = Field(
        None,
        description="wavelength of the roughness, in the job's unit; default: an eighth of the part's diagonal, or "
        "half of `within`",
    )
    seed: Seed = 0

    def build(self, origin: Floats, diagonal: float) -> Any:
        from manifold3d import Manifold, Mesh64

        foot = self.point - origin
        far = diagonal + float(np.linalg.norm(foot))
        reach = self.within or far
        grain = self.grain or (self.within / 2 if self.within else diagonal / 8)
        # the grid must resolve the field's finest octave; more than 400 cells make no visible difference
        cells = min(400, math.ceil(2.4 * reach / (grain / 12))) if self.roughness else 1
        # a cone from the border of the grid to a far tip: it contains all of the half space near the part
        line = np.linspace(-1.2 * reach, 1.2 * reach, cells + 1)
        x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
        flat = np.column_stack([x, y, np.zeros_like(x)])
        height = (
            self.roughness * _random_field.RandomField.build(grain, 3, self.seed).evaluate(flat)
            if self.roughness
            else 0 * x
        )
        tip = (0.0, 0.0, 12 * far)
        number = np.arange(len(x)).reshape(cells + 1, cells + 1)
        a, b, c, d = (n.ravel() for n in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
        faces = np.concatenate([np.column_stack([a, c, b]), np.column_stack([a, d, c])])
        rim = np.concatenate([number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]])
        faces = np.concatenate([faces, np.column_stack([rim, np.roll(rim, -1), np.full(len(rim), len(x))])])
        vertices = np.concatenate([np.column_stack([x, y, height]), [tip]])
        side = Manifold(Mesh64(np.ascontiguousarray(vertices), faces.astype(np.uint64)))
        if self.within:
            bar = Manifold.cylinder(2 * far, self.within, self.within, _count_segments(self.within, diagonal), True)
            side ^= bar
        return _place(side, self.normal, foot)


class BlobTool(Tool):
    """An irregular body with a surface like a fracture: a sphere whose radius varies smoothly and at random."""

    tool: Literal["blob"] = "blob"
    centre: Vector = Field(description="centre, in the part's frame")
    radius: PositiveFloat = Field(description="mean radius, in the job's unit")
    roughness: float | None = Field(
        None, ge=0, description="rms variation of the radius, in the job's unit; default: 0.12 of the radius"
    )
    seed: Seed = 0

    def build(self, origin: Floats, diagonal: float) -> Any:
        from manifold3d import Manifold

        share = 0.12 if self.roughness is None else self.roughness / self.radius
        field = _random_field.RandomField.build(1.6, 3, self.seed)

        # the radius is a positive function of the direction, so the surface cannot intersect itself
        def displace(points: Floats) -> Floats:
            out = normalise(points)
            return np.asarray(out * (self.radius * np.maximum(1 + share * field.evaluate(out), 0.2))[:, None])

        segments = max(96, _count_segments(self.radius, diagonal))
        return Manifold.sphere(1.0, segments).warp_batch(displace).translate(tuple(self.centre - origin))


class MeshTool(Tool):
    """A closed mesh from a file whose lengths are in the job's unit."""

    tool: Literal["mesh"] = "mesh"
    path: JobPath = Field(description="an STL, PLY, OBJ, OFF or 3MF file, relative to the job's folder")
    transform: RigidMatrix | None = Field(
        None, description="4x4, rigid, from the file's frame to the part's; default: identity"
    )

    def build(self, origin: Floats, diagonal: float) -> Any:
        from damageest.geometry.make_part import make_part
        from damageest.geometry.solids import to_manifold
        from damageest.io.meshes import read_mesh

        vertices, faces, _ = read_mesh(self.path)
        solid = make_part(vertices, faces, path=str(self.path))
        T = np.eye(4) if self.transform is None else np.array(self.transform)
        body = to_manifold(solid).transform(np.ascontiguousarray(T[:3]))
        return body.translate(tuple(-origin))


SolidTool = Annotated[SphereTool | BoxTool | CylinderTool | BlobTool | MeshTool, Field(discriminator="tool")]
"""A tool that is a body by itself."""

AnyTool = Annotated[SphereTool | BoxTool | CylinderTool | PlaneTool | BlobTool | MeshTool, Field(discriminator="tool")]


def _count_segments(radius: float, diagonal: float) -> int:
    """Number of segments of a circle, so that chords deviate by at most 0.00005 of the part's diagonal."""
    step = math.acos(max(0.0, 1 - 5e-5 * diagonal / radius))
    return 4 * min(150, max(8, math.ceil(math.pi / step / 4)))


def _place(body: Any, axis: Vector, foot: Floats) -> Any:
    """A body that was made along z, rotated to ``axis`` and moved to ``foot`` (3,)."""
    z = np.array(axis) / np.linalg.norm(axis)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return body.transform(np.ascontiguousarray(np.column_stack([x, np.cross(z, x), z, foot])))
