"""Fields of the values between stages: each of the type and in the range that its class declares."""

from __future__ import annotations

import dataclasses
import sys
import types
import typing
from collections.abc import Mapping
from functools import cache
from numbers import Integral, Real
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from damageest.errors import clean_message

MOST = sys.float_info.max
"""The largest finite number."""
TEXTS = ("notes", "doubts", "warnings", "text", "why")
"""Names of fields with text that is shown to people, and may be a plugin's."""


class ArtefactError(ValueError):
    """The data do not fit the artefact's type: wrong shapes, indices out of range, a solid that is not closed."""


class Span(NamedTuple):
    """The range of a number, or of each number of a tuple, in its ``Annotated``; both ends are in it."""

    low: float = -MOST
    high: float = MOST


class Shape:
    """The shape of an array, in its ``Annotated``: lengths, and letters for any length, each the same in all fields of
    a value. ``finite``: whether infinite numbers and NaN are refused."""

    def __init__(self, *lengths: int | str, finite: bool = True) -> None:
        self.lengths, self.finite = lengths, finite


NotNegative = Annotated[float, Span(0.0)]
Share = Annotated[float, Span(0.0, 1.0)]
Count = Annotated[int, Span(0)]


class _Field(NamedTuple):
    hint: Any
    dtype: Any
    span: Span
    shape: Shape | None


class Checked:
    """Checks the fields of a dataclass against their annotations when it is made, and raises ArtefactError.

    Numbers are finite, or in the `Span` of the field's ``Annotated``; numbers of NumPy become Python's, lists become
    tuples, and texts in the fields of `TEXTS` are cleaned. Arrays become read-only arrays of the annotation's type, and
    have the `Shape` of their ``Annotated``; a number that the type cannot hold is an error.
    """

    def __post_init__(self) -> None:
        cls: Any = type(self)
        fields = _read_fields(cls)
        for name, (hint, dtype, span, _) in fields.items():
            value = getattr(self, name)
            if dtype is None:
                checked = _check_value(value, hint, name, span)
            elif value is None and type(None) in typing.get_args(hint):
                continue
            else:
                checked = make_array(value, dtype, name)
            if checked is not value:
                object.__setattr__(self, name, checked)
        known: dict[int | str, int] = {}
        for name, (_, _, _, shape) in fields.items():
            if shape is not None and (array := getattr(self, name)) is not None:
                require_shape(name, array, *(known.get(length, length) for length in shape.lengths))
                known |= zip(shape.lengths, array.shape, strict=True)
                if shape.finite and array.dtype.kind == "f":
                    require_finite(name, array)


def make_array(value: Any, dtype: Any, name: str) -> NDArray[Any]:
    """A read-only array. Raises ArtefactError for values that ``dtype`` cannot hold, for example -1 or 0.5 as a
    label."""
    try:
        given = np.asarray(value)
    except (ValueError, TypeError) as error:
        raise ArtefactError(f"{name}: is no array ({clean_message(error, 200)})") from None
    if given.dtype.kind not in "biuf":
        raise ArtefactError(f"{name}: expected an array of numbers, got {_name_type(value)} of {given.dtype}")
    with np.errstate(invalid="ignore", over="ignore"):
        array = np.array(given, dtype=dtype, order="C", copy=None)
        if array.dtype.kind in "biu" and not np.can_cast(given.dtype, array.dtype):
            wrong = array != given
            if wrong.any():
                first = given.reshape(-1)[int(wrong.reshape(-1).argmax())]
                raise ArtefactError(f"{name}: expected {array.dtype}, got {first} and {int(wrong.sum()) - 1} more")
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


def require_shape(name: str, array: NDArray[Any], *shape: int | str) -> None:
    """Raises ArtefactError for another shape; a letter stands for any length."""
    if array.ndim != len(shape) or any(isinstance(n, int) and n != m for n, m in zip(shape, array.shape, strict=True)):
        wanted = ",".join(map(str, shape)) + ("," if len(shape) == 1 else "")
        raise ArtefactError(f"{name}: expected ({wanted}), got {array.shape}")


def require_finite(name: str, array: NDArray[Any]) -> None:
    """Raises ArtefactError where numbers of an array are infinite or none."""
    if wrong := int((~np.isfinite(array)).sum()):
        raise ArtefactError(f"{name}: {wrong} of {array.size} are not finite numbers")


def require_index(name: str, array: NDArray[Any], count: int, of: str, least: int = 0) -> None:
    """Raises ArtefactError for whole numbers outside ``least`` to ``count`` - 1, with ``of`` what they count."""
    if array.size and not least <= int(array.min()) <= int(array.max()) < count:
        raise ArtefactError(f"{name}: index outside the {count} {of}: {int(array.min())} to {int(array.max())}")


@cache
def _read_fields(cls: Any) -> Mapping[str, _Field]:
    """What each field of a dataclass is, by its name."""
    hints, whole = typing.get_type_hints(cls), typing.get_type_hints(cls, include_extras=True)
    found = {}
    for name in (field.name for field in dataclasses.fields(cls) if field.init):
        notes = getattr(whole[name], "__metadata__", ())
        span = next((note for note in notes if isinstance(note, Span)), Span())
        shape = next((note for note in notes if isinstance(note, Shape)), None)
        found[name] = _Field(hints[name], _find_dtype(hints[name]), span, shape)
    return found


def _find_dtype(hint: Any) -> Any:
    """The type of an array's numbers; None for what is no array."""
    if typing.get_origin(hint) is np.ndarray:
        (dtype,) = typing.get_args(typing.get_args(hint)[1])
        return dtype
    is_union = isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union
    return next((dtype for one in typing.get_args(hint) if (dtype := _find_dtype(one))), None) if is_union else None


def _check_value(value: Any, hint: Any, name: str, span: Span) -> Any:
    """The value, as a Python type. Raises ArtefactError where it is not of the type ``hint``, or outside ``span``."""
    outer, inner = typing.get_origin(hint), typing.get_args(hint)
    if outer in (typing.Union, types.UnionType):
        if value is None and type(None) in inner:
            return None
        (hint,) = (kind for kind in inner if kind is not type(None))
        return _check_value(value, hint, name, span)
    if hint in (int, float):
        return _check_number(value, hint, name, span)
    if outer is tuple:
        return _check_tuple(value, inner, name, span)
    kind = {bool: (bool, np.bool_)}.get(hint, outer or hint)
    if not isinstance(value, kind):
        raise ArtefactError(f"{name}: expected {_name_hint(outer or hint)}, got {_name_type(value)}")
    if hint is str and name in TEXTS:
        clean = clean_message(value)
        return value if clean == value else clean
    return bool(value) if hint is bool else value


def _check_number(value: Any, hint: type, name: str, span: Span) -> Any:
    is_number = isinstance(value, Integral if hint is int else Real) and not isinstance(value, (bool, np.bool_))
    if not is_number:
        raise ArtefactError(f"{name}: expected {_name_hint(hint)}, got {_name_type(value)}")
    if not span[0] <= value <= span[1]:  # not for one that is no number, either
        low, high = (f"{end:g}" for end in span)
        wanted = "a finite number" if span == Span() else f"a number of at least {low}"
        wanted = wanted if span[1] >= MOST else f"a number from {low} to {high}"
        raise ArtefactError(f"{name}: expected {wanted}, got {value}")
    return value if type(value) is hint else hint(value)


def _check_tuple(value: Any, inner: tuple[Any, ...], name: str, span: Span) -> Any:
    if not isinstance(value, (tuple, list)):
        raise ArtefactError(f"{name}: expected a tuple, got {_name_type(value)}")
    hints = [inner[0]] * len(value) if inner[1:] == (Ellipsis,) else list(inner)
    if len(hints) != len(value):
        raise ArtefactError(f"{name}: expected {len(hints)} values, got {len(value)}")
    if not any(hint not in (str,) or name in TEXTS for hint in hints) and all(type(item) is str for item in value):
        return value if type(value) is tuple else tuple(value)
    checked = tuple(_check_value(item, hint, name, span) for item, hint in zip(value, hints, strict=True))
    same = type(value) is tuple and all(new is old for new, old in zip(checked, value, strict=True))
    return value if same else checked


def _name_hint(hint: Any) -> str:
    return {int: "a whole number", float: "a number", str: "a text", bool: "true or false"}.get(
        hint, f"a {getattr(hint, '__name__', hint)}"
    )


def _name_type(value: Any) -> str:
    return "None" if value is None else f"a {type(value).__name__}"
