"""A model of result.json that is made of a value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import ValidationError

from damageest.artefacts import Floats, Vector
from damageest.output.base import JsonModel


@dataclass(frozen=True)
class Corner:
    sharp: Annotated[bool, "whether it has no radius"] = False


@dataclass(frozen=True, eq=False)
class Edge:
    place: Annotated[Floats, "its middle"]
    kind: Literal["convex", "concave"] = "convex"
    corners: tuple[Corner, ...] = ()
    next: Corner | None = None
    hidden: float = 0.0

    @property
    def length(self) -> float:
        """Length of its curve.

        0 for a point."""
        return self.hidden


class CornerReport(JsonModel, of=Corner): ...


class ShortReport(JsonModel, of=Edge, fields="length number kind"):
    number: int


class EdgeReport(JsonModel, of=Edge, without=("hidden",)):
    """An edge."""

    place: Vector
    number: int


def test_it_has_the_fields_of_the_value_without_its_defaults() -> None:
    schema = EdgeReport.model_json_schema(mode="serialization")
    assert list(schema["properties"]) == schema["required"] == ["place", "kind", "corners", "next", "number"]
    assert schema["properties"]["place"]["description"] == "its middle"
    assert schema["properties"]["place"]["maxItems"] == 3
    assert schema["properties"]["corners"]["items"] == {"$ref": "#/$defs/CornerReport"}
    assert schema["$defs"]["CornerReport"]["properties"]["sharp"]["description"] == "whether it has no radius"
    assert schema["description"] == "An edge."


def test_it_is_filled_from_the_value() -> None:
    edge = Edge(np.array([1.0, 2.0, 3.0]), "concave", (Corner(True),), None, 5.0)
    assert EdgeReport.read(edge, number=4).model_dump(mode="json") == {
        "place": [1.0, 2.0, 3.0], "kind": "concave", "corners": [{"sharp": True}], "next": None, "number": 4,
    }  # fmt: skip
    with pytest.raises(ValidationError, match="number"):
        EdgeReport.read(edge, number="none")


def test_fields_are_named_in_the_order_of_json() -> None:
    schema = ShortReport.model_json_schema(mode="serialization")
    assert list(schema["properties"]) == schema["required"] == ["length", "number", "kind"]
    assert schema["properties"]["length"] == {"description": "length of its curve", "title": "Length", "type": "number"}
    edge = Edge(np.zeros(3), hidden=2.0)
    assert ShortReport.read(edge, number=1).model_dump() == {"length": 2.0, "number": 1, "kind": "convex"}
