"""The formats that a job names, checked with the job against what the plugins here can write."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from damageest.errors import suggest

PLUGINS = {"step": "damageest-cadquery"}
"""The plugin that has a format, for whoever lacks it."""


def _check_known(name: str, info: ValidationInfo) -> str:
    registry = (info.context or {}).get("registry")
    if registry is None or name in registry.writers:
        return name
    if plugin := PLUGINS.get(name):
        raise _make_error(f"'{name}' needs {registry.describe_plugin(plugin)}")
    names = sorted(registry.writers)
    raise _make_error(f"no format '{name}'{suggest(name, names)}; there are: {', '.join(names)}{registry.missing()}")


def _make_error(text: str) -> PydanticCustomError:
    return PydanticCustomError("format", "{text}", {"text": text})


def check_spline_writer(wanted: bool, info: ValidationInfo) -> bool:
    """Refuses a spline where nothing here can write one."""
    registry = (info.context or {}).get("registry")
    if wanted and registry is not None and not any(writer.patch for writer in registry.writers.values()):
        raise _make_error(f"a spline needs {registry.describe_plugin(PLUGINS['step'])}")
    return wanted


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
"""One format or a list; each once."""
