"""The base of all models of result.json."""

from __future__ import annotations

import functools
import inspect
import math
import operator
import types
import typing
from collections.abc import Collection
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, field_validator


class JsonModel(BaseModel):
    """A part of result.json, and of its schema. It is filled from the attributes of a value with the same names; an
    array becomes a list.

    ``class SomeReport(JsonModel, of=Some)`` has the fields of the dataclass ``Some``, but for those of ``without``: in
    its order, with its types and the texts of its ``Annotated``, and without its defaults. An annotation in the class
    itself replaces the type.
    """

    model_config = ConfigDict(extra="forbid", populate_by_name=True, defer_build=True, from_attributes=True)

    def __init_subclass__(cls, of: type | None = None, without: Collection[str] = (), **more: Any) -> None:
        super().__init_subclass__(**more)
        if of is not None:
            own = inspect.get_annotations(cls)
            cls.__annotations__ = _derive_fields(of, without, own) | own
            _MODELS[of] = cls

    @field_validator("*", mode="before")
    @classmethod
    def _list_array(cls, value: Any) -> Any:
        return value.tolist() if isinstance(value, np.ndarray) else value

    @classmethod
    def read(cls, source: Any, **others: Any) -> Self:
        """The model of ``source``, whose attributes are its fields, but for the ``others``."""
        return cls(**{name: getattr(source, name) for name in cls.model_fields if name not in others}, **others)


_MODELS: dict[Any, type[JsonModel]] = {}
"""The model of each value that has one."""


def _derive_fields(of: type, without: Collection[str], own: dict[str, Any]) -> dict[str, Any]:
    """The types of the fields of a dataclass in JSON, with their texts."""
    derived = {}
    for name, hint in typing.get_type_hints(of, include_extras=True).items():
        if name not in without:
            kind, *texts = typing.get_args(hint) if typing.get_origin(hint) is Annotated else (hint,)
            kind = own.pop(name) if name in own else _to_json(kind)
            derived[name] = Annotated[kind, Field(description=texts[0])] if texts else kind
    return derived


def _to_json(kind: Any) -> Any:
    """A type as JSON has it: a tuple of any length is a list, a value its model."""
    items = typing.get_args(kind)
    if isinstance(kind, types.UnionType):
        return functools.reduce(operator.or_, map(_to_json, items))
    if typing.get_origin(kind) is tuple and items[-1] is ...:
        return list[_to_json(items[0])]  # type: ignore[misc]
    return _MODELS.get(kind, kind)


Bound = Annotated[float | None, BeforeValidator(lambda value: value if math.isfinite(value) else None)]
"""A number that is null where it is infinite: nothing limits it."""


def strip_frame(name: str) -> str:
    """The path of a file below the folder of its frame."""
    return name.removeprefix("scan_frame/").removeprefix("nominal_frame/")
