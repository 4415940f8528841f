"""Options for file formats, checked with the job: is there a writer for each?"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from damageest.errors import suggest


def _check_known(name: str, info: ValidationInfo) -> str:
    registry = (info.context or {}).get("registry")
    if registry is None or name in registry.writers:
        return name
    if needed := registry.describe_writer(name):
        raise _make_error(f"'{name}' needs {needed}")
    names = sorted(registry.writers)
    raise _make_error(f"no format '{name}'{suggest(name, names)}; there are: {', '.join(names)}{registry.missing()}")


def _check_known_path(name: str, info: ValidationInfo) -> str:
    registry = (info.context or {}).get("registry")
    if registry is None or name in registry.path_writers:
        return name
    names = sorted(registry.path_writers)
    raise _make_error(
        f"no format of paths '{name}'{suggest(name, names)}; there are: {', '.join(names)}{registry.missing()}"
    )


def _make_error(text: str) -> PydanticCustomError:
    return PydanticCustomError("format", "{text}", {"text": text})


def check_spline_writer(spline: bool, info: ValidationInfo) -> bool:
    """Refuses a spline where no writer can write one."""
    registry = (info.context or {}).get("registry")
    if spline and registry is not None and not any(writer.patch for writer in registry.writers.values()):
        raise _make_error(f"a spline needs {registry.describe_writer('step')}")
    return spline


Format = Annotated[str, AfterValidator(_check_known), Field(examples=["stl", "ply", "3mf", "step"])]
Formats = Annotated[
    tuple[Format, ...],
    BeforeValidator(
        lambda value: (value,) if isinstance(value, str) else value,
        json_schema_input_type=Format | Annotated[list[Format], Field(min_length=1)],
    ),
    AfterValidator(lambda names: tuple(dict.fromkeys(names))),
    Field(min_length=1),
]
"""One format or a list of formats, without duplicates."""

PathFormat = Annotated[str, AfterValidator(_check_known_path), Field(examples=["csv", "apt", "rs274"])]
PathFormats = Annotated[
    tuple[PathFormat, ...],
    BeforeValidator(
        lambda value: (value,) if isinstance(value, str) else value,
        json_schema_input_type=PathFormat | list[PathFormat],
    ),
    AfterValidator(lambda names: tuple(dict.fromkeys(names))),
]
"""Formats of deposition paths, without duplicates; none is allowed."""

PathOption = Annotated[
    str,
    BeforeValidator(
        lambda value: f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else value,
        json_schema_input_type=str | float,
    ),
]
"""What a job says for a writer of paths: a text, or a number."""
