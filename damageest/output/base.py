"""The base of all models of result.json, and the one that most of them share, of a reason."""

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

from damageest.artefacts import Reason


class JsonModel(BaseModel):
    """A part of result.json, and of its schema. It is filled from the attributes of a value with the same names; an
    array becomes a list.

    ``class SomeReport(JsonModel, of=Some)`` has the fields of the dataclass ``Some``, but for those of ``without``: in
    its order, with its types and the texts of its ``Annotated``, and without its defaults. ``fields``: names of those
    that it has, and of properties of ``Some``, in the order of JSON; ``held=is_held``: another name in JSON. An
    annotation in the class itself replaces a field's type or a property, or adds a field.
    """

    model_config = ConfigDict(extra="forbid", populate_by_name=True, defer_build=True, from_attributes=True)

    def __init_subclass__(
        cls, of: type | None = None, without: Collection[str] = (), fields: str = "", **more: Any
    ) -> None:
        super().__init_subclass__(**more)
        if of is not None:
            own = inspect.get_annotations(cls)
            hints = typing.get_type_hints(of, include_extras=True)
            names = fields.split() or [name for name in hints if name not in without]
            pairs = [(name, source or name) for name, _, source in (one.partition("=") for one in names)]
            cls.__annotations__ = {
                name: _derive_field(of, source, hints, own.pop(name, None)) for name, source in pairs
            } | own
            _MODELS.setdefault(of, cls)

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


def _derive_field(of: type, name: str, hints: dict[str, Any], own: Any) -> Any:
    """The type in JSON of a field or property of a class, with its text: of a property the first paragraph of its
    docstring. ``own``: the type that the model has."""
    hint, text = hints.get(name), ""
    if hint is None and own is None and (member := getattr(of, name, None)) is not None:
        getter = member.fget if isinstance(member, property) else member.func
        hint, words = typing.get_type_hints(getter)["return"], inspect.getdoc(getter) or ""
        text = " ".join((words[:1].lower() + words[1:]).partition("\n\n")[0].removesuffix(".").split())
    elif typing.get_origin(hint) is Annotated:
        hint, *notes = typing.get_args(hint)
        text = next((note for note in notes if isinstance(note, str)), "")
    kind = own or _to_json(hint)
    return Annotated[kind, Field(description=text)] if text else kind


def _to_json(kind: Any) -> Any:
    """A type as JSON has it: a tuple of any length is a list, a value its model."""
    items = typing.get_args(kind)
    if isinstance(kind, types.UnionType):
        return functools.reduce(operator.or_, map(_to_json, items))
    if typing.get_origin(kind) is tuple and items[-1] is ...:
        return list[_to_json(items[0])]  # type: ignore[misc]
    return _MODELS.get(kind, kind)


class ReasonReport(JsonModel, of=Reason, fields="code effect amount unit place text remedy"): ...


Bound = Annotated[float | None, BeforeValidator(lambda value: value if math.isfinite(value) else None)]
"""A number that is null where it is infinite: nothing limits it."""


def strip_frame(name: str) -> str:
    """The path of a file below the folder of its frame."""
    return name.removeprefix("scan_frame/").removeprefix("nominal_frame/")
