"""Options that select what stock stands on and what is kept free of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from damageest.artefacts import Floats, Ints, Part
from damageest.geometry.selectors import Mask, Plane, Selector, StrictMapping, Vector
from damageest.stages import JobPath


class StockTarget(Selector):
    """Skin with its own height of stock."""

    outer: float = Field(
        ge=0, allow_inf_nan=False, description="height of the stock on this skin, in the job's unit; 0: none"
    )


class Bar(StrictMapping):
    """A solid round bar."""

    start: Vector = Field(alias="from", description="centre of one end, in part coordinates, in the job's unit")
    end: Vector = Field(alias="to", description="centre of the other end")
    radius: float = Field(gt=0, allow_inf_nan=False, description="radius, in the job's unit")

    @model_validator(mode="after")
    def _check_length(self) -> Self:
        if not np.linalg.norm(np.subtract(self.end, self.start)) > 0:
            raise ValueError("from and to are the same point; give two different points")
        return self


class KeepOut(Selector):
    """A solid that the deposit must not enter, or skin that gets no stock.

    A box alone is a solid; with other conditions it selects skin.
    """

    cylinder: Bar | None = Field(None, description="a solid round bar: from, to, radius")
    mesh: JobPath | None = Field(None, description="a watertight mesh file in part coordinates, in the job's unit")

    def find_fault(self) -> str:
        """What is wrong with the conditions and solids as a whole; empty where nothing is."""
        solids = [name for name in ("cylinder", "mesh") if getattr(self, name) is not None]
        one = len(solids) + bool(self.conditions()) == 1
        return (
            ""
            if one
            else "give one of: cylinder; mesh; a box; or conditions on skin: half_space, facing, faces, at, kind"
        )

    def is_solid(self) -> bool:
        """Whether it describes a solid, not skin."""
        return self.conditions() in ([], ["box"])

    def bound_solid(self) -> Floats | None:
        """(2,3) corners of the box round the solid; None for skin, or for a file."""
        if self.cylinder is not None:
            ends = np.array([self.cylinder.start, self.cylinder.end])
            axis = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
            wide = self.cylinder.radius * np.sqrt(np.maximum(1 - axis**2, 0))
            return np.array([ends.min(axis=0) - wide, ends.max(axis=0) + wide])
        return np.array(self.box) if self.conditions() == ["box"] else None

    def chooses_skin(self) -> bool:
        """Whether it selects skin that gets no stock."""
        return not self.is_solid()


@dataclass(frozen=True)
class StockPlan:
    """The stock that a job asks for: ``outer`` where none of ``targets`` matches, and what to keep free."""

    outer: float
    targets: tuple[StockTarget, ...]
    keep_out: tuple[KeepOut, ...]

    @property
    def max_height(self) -> float:
        """The largest height of stock."""
        return max([self.outer, *(target.outer for target in self.targets)])

    def skin_to_keep_free(self) -> tuple[KeepOut, ...]:
        """The items of ``keep_out`` that select skin."""
        return tuple(item for item in self.keep_out if not item.is_solid())

    def planes(self, origin: Floats) -> list[Plane]:
        """All planes along which skin has to be cut before its stock is looked up; relative to ``origin`` (3,)."""
        return [plane for item in (*self.targets, *self.skin_to_keep_free()) for plane in item.planes(origin)]

    def is_kept_free(self, points: Floats, normals: Floats, parents: Ints, part: Part) -> Mask:
        """(N,) whether skin must have no stock; arguments as of `Selector.matches`."""
        found = np.zeros(len(points), bool)
        for item in self.skin_to_keep_free():
            found |= item.matches(points, normals, parents, part)
        return found

    def heights(self, points: Floats, normals: Floats, parents: Ints, part: Part) -> Floats:
        """(N,) height of the stock on skin; arguments as of `Selector.matches`."""
        height = np.full(len(points), self.outer)
        for target in reversed(self.targets):
            height[target.matches(points, normals, parents, part)] = target.outer
        height[self.is_kept_free(points, normals, parents, part)] = 0.0
        return height
