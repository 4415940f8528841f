"""Which skin of the part is meant: by place, by direction, by CAD face, by kind of surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from damageest.artefacts import Floats, Ints, Part
from damageest.errors import StageError, suggest
from damageest.stages import JobPath

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Mask = NDArray[np.bool_]
Plane = tuple[Floats, float]
"""Unit normal (3,) and offset: points x with ``normal . x > offset`` are beyond it."""

MAX_LISTED = 12
"""Valid names that an error lists at most."""


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


class StrictMapping(BaseModel):
    """A mapping in a job that says which keys it takes when it gets another."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, serialize_by_alias=True)

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
    """Everything on the side of a plane that its normal points to."""

    point: Vector = Field(description="on the plane, in part coordinates, in the job's unit")
    normal: Direction = Field(description="toward the side that is meant; its length does not matter")


class Facing(StrictMapping):
    """Skin whose outward normal is close to a direction."""

    direction: Direction = Field(description="in part coordinates; its length does not matter")
    angle: float = Field(30.0, gt=0, le=180, description="degrees between it and the skin's outward normal, at most")


class Selector(StrictMapping):
    """Skin of the part. Of several conditions, all have to hold."""

    box: Corners | None = Field(None, description="lowest and highest corner in part coordinates, in the job's unit")
    half_space: HalfSpace | None = Field(
        None, description="point and normal of a plane; the side it points to is meant"
    )
    facing: Facing | None = Field(
        None, description="direction of the outward normal, and the angle about it in degrees"
    )
    faces: tuple[int | str, ...] = Field((), description="numbers or names of CAD faces, as the part's file gives them")
    kind: Literal["plane", "cylinder", "other"] | None = Field(None, description="of the CAD face's surface")

    @model_validator(mode="after")
    def _check_conditions(self) -> Self:
        if fault := self.find_fault():
            raise ValueError(fault)
        return self

    def find_fault(self) -> str:
        """What is wrong with the conditions together; empty where nothing is."""
        return "" if self.conditions() else f"says no skin; give one or more of: {', '.join(Selector.model_fields)}"

    def conditions(self) -> list[str]:
        """Names of the conditions that are given."""
        return [name for name in Selector.model_fields if getattr(self, name) not in (None, ())]

    def planes(self, origin: Floats) -> list[Plane]:
        """Planes that bound what is meant; skin has to be cut along them first. Relative to ``origin`` (3,)."""
        found: list[Plane] = []
        if self.box is not None:
            for corner in self.box:
                found += [(axis, float(axis @ (np.array(corner) - origin))) for axis in np.eye(3)]
        if self.half_space is not None:
            normal = np.array(self.half_space.normal) / np.linalg.norm(self.half_space.normal)
            found.append((normal, float(normal @ (np.array(self.half_space.point) - origin))))
        return found

    def matches(self, points: Floats, normals: Floats, parents: Ints, part: Part) -> Mask:
        """(N,) whether skin at points (N,3) in part coordinates, with outward normals (N,3), on the part's triangles
        ``parents`` (N,), is meant. Raises StageError where the part does not know the face."""
        meant = np.ones(len(points), bool)
        if self.box is not None:
            meant &= ((points >= self.box[0]) & (points <= self.box[1])).all(axis=1)
        if self.half_space is not None:
            meant &= (points - np.array(self.half_space.point)) @ np.array(self.half_space.normal) >= 0
        if self.facing is not None:
            direction = np.array(self.facing.direction) / np.linalg.norm(self.facing.direction)
            meant &= normals @ direction >= np.cos(np.radians(self.facing.angle)) - 1e-12
        if self.faces:
            meant &= np.isin(_require_brep(part, "faces")[parents], [_find_number(part, face) for face in self.faces])
        if self.kind is not None:
            numbers = _require_brep(part, "kind")
            kinds = np.array([kind if kind in ("plane", "cylinder") else "other" for kind in part.face_kinds])
            meant &= (kinds == self.kind)[numbers[parents]]
        return meant


class StockTarget(Selector):
    """Skin that gets stock of its own."""

    outer: float = Field(ge=0, allow_inf_nan=False, description="stock beyond this skin, in the job's unit; 0: none")


class Bar(StrictMapping):
    """A round bar."""

    start: Vector = Field(alias="from", description="centre of one end, in part coordinates, in the job's unit")
    end: Vector = Field(alias="to", description="centre of the other end")
    radius: float = Field(gt=0, allow_inf_nan=False, description="in the job's unit")

    @model_validator(mode="after")
    def _check_length(self) -> Self:
        if not np.linalg.norm(np.subtract(self.end, self.start)) > 0:
            raise ValueError("from and to are the same point; a bar has a length")
        return self


class KeepOut(Selector):
    """A solid, or skin, that the deposit must not enter. A box alone is a solid; beside another condition it narrows
    the skin."""

    cylinder: Bar | None = Field(None, description="a solid round bar: from, to, radius")
    mesh: JobPath | None = Field(None, description="a watertight mesh file in part coordinates, in the job's unit")

    def find_fault(self) -> str:
        """As of skin, or of a solid."""
        solids = [name for name in ("cylinder", "mesh") if getattr(self, name) is not None]
        one = len(solids) + bool(self.conditions()) == 1
        return (
            "" if one else "give one of: cylinder; mesh; a box; or conditions on skin: half_space, facing, faces, kind"
        )

    def is_solid(self) -> bool:
        return self.conditions() in ([], ["box"])


@dataclass(frozen=True)
class StockPlan:
    """What a job asks for: stock of ``outer`` where no target matches, and what to keep free."""

    outer: float
    targets: tuple[StockTarget, ...]
    keep_out: tuple[KeepOut, ...]

    @property
    def max_height(self) -> float:
        """The largest stock that skin may get."""
        return max([self.outer, *(target.outer for target in self.targets)])

    def skin_to_keep_free(self) -> tuple[KeepOut, ...]:
        return tuple(item for item in self.keep_out if not item.is_solid())

    def planes(self, origin: Floats) -> list[Plane]:
        """All planes along which skin is to be cut before it is sorted."""
        return [plane for item in (*self.targets, *self.skin_to_keep_free()) for plane in item.planes(origin)]

    def is_kept_free(self, points: Floats, normals: Floats, parents: Ints, part: Part) -> Mask:
        """(N,) skin that must stay without stock; as `Selector.matches`."""
        found = np.zeros(len(points), bool)
        for item in self.skin_to_keep_free():
            found |= item.matches(points, normals, parents, part)
        return found

    def heights(self, points: Floats, normals: Floats, parents: Ints, part: Part) -> Floats:
        """(N,) stock wanted on skin; as `Selector.matches`."""
        height = np.full(len(points), self.outer)
        for target in reversed(self.targets):
            height[target.matches(points, normals, parents, part)] = target.outer
        height[self.is_kept_free(points, normals, parents, part)] = 0.0
        return height


def _require_brep(part: Part, option: str) -> Ints:
    if part.faces_brep is None:
        raise StageError(
            f"'{option}' picks CAD faces, and the part is a mesh, which has none",
            "a part from STEP, IGES or BREP; or pick skin by box, half_space or facing",
        )
    return part.faces_brep


def _find_number(part: Part, face: int | str) -> int:
    """The number of a CAD face given by number or name."""
    assert part.faces_brep is not None
    count = max(int(part.faces_brep.max()) + 1, len(part.face_kinds))
    if isinstance(face, int):
        if not 0 <= face < count:
            raise StageError(f"the part has no CAD face {face}", f"a number from 0 to {count - 1}")
        return face
    names: Sequence[str] = [name for name in part.face_names if name]
    if face in names:
        return part.face_names.index(face)
    if not names:
        raise StageError(f"no CAD face '{face}': the part's faces have no names", f"a number from 0 to {count - 1}")
    listed = ", ".join(names[:MAX_LISTED]) + (f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else "")
    raise StageError(
        f"no CAD face '{face}'{suggest(face, names)}", f"a name of: {listed}; or a number up to {count - 1}"
    )
