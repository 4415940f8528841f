"""The base of all models of result.json."""

from __future__ import annotations

import math
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, field_validator


class JsonModel(BaseModel):
    """A part of result.json, and of its schema. It is filled from the attributes of a value with the same names; an
    array becomes a list."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True, defer_build=True, from_attributes=True)

    @field_validator("*", mode="before")
    @classmethod
    def _list_array(cls, value: Any) -> Any:
        return value.tolist() if isinstance(value, np.ndarray) else value

    @classmethod
    def read(cls, source: Any, **others: Any) -> Self:
        """The model of ``source``, whose attributes are its fields, but for the ``others``."""
        return cls(**{name: getattr(source, name) for name in cls.model_fields if name not in others}, **others)


Bound = Annotated[float | None, BeforeValidator(lambda value: value if math.isfinite(value) else None)]
"""A number that is null where it is infinite: nothing limits it."""


def strip_frame(name: str) -> str:
    """The path of a file below the folder of its frame."""
    return name.removeprefix("scan_frame/").removeprefix("nominal_frame/")
