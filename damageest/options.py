"""The base of all options that a job may set: a number is a number, and finite."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema


def _guard_numbers(schema: Any) -> Any:
    """A schema whose numbers, at any depth, refuse texts and truth values. Models within have done so themselves."""
    if isinstance(schema, list):
        return [_guard_numbers(item) for item in schema]
    if isinstance(schema, tuple):
        return tuple(_guard_numbers(item) for item in schema)
    if not isinstance(schema, dict):
        return schema
    if schema.get("type") in ("int", "float"):
        return core_schema.no_info_before_validator_function(require_number, schema)
    if schema.get("type") == "function-before" and schema["function"].get("function") is require_number:
        return schema
    return {key: value if key in _FIXED else _guard_numbers(value) for key, value in schema.items()}


_FIXED = ("metadata", "config", "serialization", "default", "expected", "function", "cls", "ref")
"""Parts of a schema that describe no value of a job."""


def require_number(value: Any) -> Any:
    """Refuses values that Python or pydantic would read as a number, but a reader of the job file would not."""
    # numpy's truth value by its name: this module is imported for --help, which needs no numpy
    is_numpy_bool = type(value).__module__ == "numpy" and type(value).__name__ in ("bool", "bool_")
    if is_numpy_bool or isinstance(value, (bool, str, bytes)):
        raise PydanticCustomError("number", "expected a number")
    return value


class Options(BaseModel):
    """Options of a stage, or one of them that has options of its own.

    Numbers are finite, and neither ``true`` nor a text as "5" passes as one. An option for which infinity means
    something has ``Field(allow_inf_nan=True)``, and its description says what.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        schema: CoreSchema = _guard_numbers(handler(source))
        return schema
