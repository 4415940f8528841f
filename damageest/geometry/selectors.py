"""Selectors of the part's skin, as options of a job: by place, by direction, by CAD face, by kind of surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from damageest.artefacts import Floats, Ints, Part
from damageest.errors import StageError, suggest
from damageest.geometry.cutting import cut_triangles
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.smooth_faces import label_smooth_faces
from damageest.options import Options

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Mask = NDArray[np.bool_]
Plane = tuple[Floats, float]
"""Unit normal (3,) and offset: points x with ``normal . x > offset`` are beyond it."""

ON_PLANE = 1e-7
"""Distance from a plane, in diagonals of the part, up to which a corner lies on it."""
PICKED = 0.02
"""Distance from the skin, in diagonals of the part, up to which a point is picked on it."""
SMOOTH = 0.87
"""Cosine of the angle between neighbouring triangles of one face, where the part is a mesh."""
MAX_LISTED = 12
"""Largest number of valid names that an error lists."""


def _check_direction(value: Vector) -> Vector:
    if not np.linalg.norm(value) > 1e-12:
        raise ValueError("a direction must have a length")
    return value


def _check_order(value: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
    if not (np.array(value[0]) < np.array(value[1])).all():
        raise ValueError("give the lowest corner first, then the highest; each coordinate of the second is larger")
    return value


Direction = Annotated[Vector, AfterValidator(_check_direction)]
Corners = Annotated[tuple[Vector, Vector], AfterValidator(_check_order)]


class StrictMapping(Options):
    """Base of mappings in a job: an unknown key is refused with a list of the valid ones."""

    model_config = ConfigDict(populate_by_name=True, serialize_by_alias=True)

    @model_validator(mode="before")
    @classmethod
    def _check_known(cls, value: Any) -> Any:
        keys = [field.alias or name for name, field in cls.model_fields.items()]
        if not isinstance(value, (dict, BaseModel)):
            raise ValueError(f"give a mapping with one or more of: {', '.join(keys)}")
        unknown = [key for key in value if key not in (*keys, *cls.model_fields)] if isinstance(value, dict) else []
        if unknown:
            raise ValueError(
                f"unknown key '{unknown[0]}'{suggest(str(unknown[0]), keys)}; valid are: {', '.join(keys)}"
            )
        return value


class HalfSpace(StrictMapping):
    """The space on the side of a plane to which its normal points."""

    point: Vector = Field(description="a point on the plane, in part coordinates, in the job's unit")
    normal: Direction = Field(description="direction to the selected side; its length does not matter")


class Facing(StrictMapping):
    """Skin whose outward normal is close to a direction."""

    direction: Direction = Field(description="in part coordinates; its length does not matter")
    angle: float = Field(
        30.0, gt=0, le=180, description="largest angle between it and the outward normal of the skin, in degrees"
    )


class Selector(StrictMapping):
    """Conditions that select skin of the part; of several conditions all must hold."""

    box: Corners | None = Field(None, description="lowest and highest corner in part coordinates, in the job's unit")
    half_space: HalfSpace | None = Field(
        None, description="point and normal of a plane; the side to which the normal points is selected"
    )
    facing: Facing | None = Field(
        None, description="direction of the outward normal, and largest angle from it in degrees"
    )
    faces: tuple[int | str, ...] = Field(
        (), description="numbers or names of CAD faces, as listed by `damageest faces`"
    )
    at: Vector | None = Field(
        None,
        description="a point picked on the skin, in part coordinates, in the job's unit: the CAD face nearest to it; "
        "of a mesh, the smooth face around it",
    )
    kind: Literal["plane", "cylinder", "other"] | None = Field(None, description="kind of the CAD face's surface")

    @model_validator(mode="after")
    def _check_conditions(self) -> Self:
        if fault := self.find_fault():
            raise ValueError(fault)
        return self

    def find_fault(self) -> str:
        """What is wrong with the conditions as a whole; empty where nothing is."""
        return "" if self.conditions() else f"selects no skin; give one or more of: {', '.join(Selector.model_fields)}"

    def conditions(self) -> list[str]:
        """Names of the given conditions."""
        return [name for name in Selector.model_fields if getattr(self, name) not in (None, ())]

    def planes(self, origin: Floats) -> list[Plane]:
        """The planes that bound the selection, relative to ``origin`` (3,); skin has to be cut along them first."""
        found: list[Plane] = []
        if self.box is not None:
            for corner in self.box:
                found += [(axis, float(axis @ (np.array(corner) - origin))) for axis in np.eye(3)]
        if self.half_space is not None:
            normal = np.array(self.half_space.normal) / np.linalg.norm(self.half_space.normal)
            found.append((normal, float(normal @ (np.array(self.half_space.point) - origin))))
        return found

    def matches(self, points: Floats, normals: Floats, parents: Ints, part: Part) -> Mask:
        """(N,) whether skin is selected.

        ``points`` (N,3) of the skin in part coordinates, its outward ``normals`` (N,3), and the part's triangles
        ``parents`` (N,) there. Raises StageError where the part has no such CAD face.
        """
        selected = np.ones(len(points), bool)
        if self.box is not None:
            selected &= ((points >= self.box[0]) & (points <= self.box[1])).all(axis=1)
        if self.half_space is not None:
            selected &= (points - np.array(self.half_space.point)) @ np.array(self.half_space.normal) >= 0
        if self.facing is not None:
            direction = np.array(self.facing.direction) / np.linalg.norm(self.facing.direction)
            selected &= normals @ direction >= np.cos(np.radians(self.facing.angle)) - 1e-12
        if self.faces:
            selected &= np.isin(_require_brep(part, "faces")[parents], [find_face(part, face) for face in self.faces])
        if self.at is not None:
            selected &= _find_picked(part, self.at)[parents]
        if self.kind is not None:
            numbers = _require_brep(part, "kind")
            kinds = np.array([kind if kind in ("plane", "cylinder") else "other" for kind in part.face_kinds])
            selected &= (kinds == self.kind)[numbers[parents]]
        return selected

    def chooses_skin(self) -> bool:
        """Whether it selects skin, rather than a region of space."""
        return True

    def finds_skin(self, part: Part) -> bool:
        """Whether it selects any of the part's skin. Raises StageError where the part has no such CAD face."""
        parents = np.arange(len(part.faces))
        flat = self.model_copy(update={"box": None, "half_space": None})
        parents = parents[flat.matches(part.triangles.mean(axis=1), part.face_normals, parents, part)]
        vertices, faces = part.vertices, part.faces[parents]
        for normal, offset in self.planes(np.zeros(3)):
            value = vertices @ normal - offset
            near = np.abs(value) < ON_PLANE * part.diagonal
            vertices, faces, kept, _ = cut_triangles(vertices, faces, np.where(near, 0.0, value))
            parents = parents[kept]
        return bool(self.matches(vertices[faces].mean(axis=1), part.face_normals[parents], parents, part).any())


def _find_picked(part: Part, at: Vector) -> Mask:
    """(F,) which triangles lie on the face that a point is picked on. Raises StageError for a point far from all."""
    distance, face, _ = closest_on_mesh(np.array([at]), part)
    if abs(distance[0]) > PICKED * part.diagonal:
        raise StageError(
            f"the point {', '.join(f'{x:g}' for x in at)} is {abs(distance[0]):.3g} {part.unit} from the part's skin",
            "pick a point on the skin, in the part's frame",
        )
    number = label_smooth_faces(part.faces, part.face_normals, SMOOTH) if part.faces_brep is None else part.faces_brep
    return np.asarray(number == number[face[0]])


def _require_brep(part: Part, option: str) -> Ints:
    if part.faces_brep is None:
        raise StageError(
            f"'{option}' selects CAD faces, but the part is a mesh and has none",
            "give the part as STEP, IGES or BREP; or select skin by box, half_space or facing",
        )
    return part.faces_brep


def find_face(part: Part, face: int | str) -> int:
    """The number of a CAD face, given by number or name. Raises StageError where the part has no such face."""
    assert part.faces_brep is not None
    count = max(int(part.faces_brep.max()) + 1, len(part.face_kinds))
    if isinstance(face, int):
        if not 0 <= face < count:
            raise StageError(f"the part has no CAD face {face}", f"give a number from 0 to {count - 1}")
        return face
    names: Sequence[str] = [name for name in part.face_names if name]
    if face in names:
        return part.face_names.index(face)
    if not names:
        raise StageError(
            f"no CAD face '{face}': the part's faces have no names", f"give a number from 0 to {count - 1}"
        )
    listed = ", ".join(names[:MAX_LISTED]) + (f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else "")
    raise StageError(
        f"no CAD face '{face}'{suggest(face, names)}", f"give one of the names {listed}; or a number up to {count - 1}"
    )
