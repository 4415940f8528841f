"""The JSON Schema of a job file, for the stages found here."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from pydantic.json_schema import models_json_schema

from damageest.job.model import Header
from damageest.registry import Implementation, Registry
from damageest.registry.contracts import DEFAULTS, STAGES

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def job_schema(registry: Registry) -> dict[str, Any]:
    """The schema of a job file: both spellings of every stage, with the options of every implementation."""
    classes = [item.cls for item in registry.implementations]
    references, shared = models_json_schema([(cls, "validation") for cls in classes], ref_template="#/$defs/{model}")
    definitions: dict[str, Any] = shared.get("$defs", {})
    head = Header.model_json_schema()
    definitions |= head.get("$defs", {})
    properties: dict[str, Any] = head["properties"]
    properties["method"]["enum"] = list(registry.methods())
    for stage in STAGES:
        items = registry.of(stage)
        mappings = [references[(item.cls, "validation")] for item in items]
        for item, reference in zip(items, mappings, strict=True):
            definition = definitions[reference["$ref"].rsplit("/", 1)[1]]
            definition["properties"]["use"] = {"const": item.name, "description": f"by {item.provider.name}"}
            required = [name for name in definition.get("required", []) if name != "use"]
            default = DEFAULTS[item.contract] == item.name
            definition["required"] = required if default else ["use", *required]
        bare = [item.name for item in items if not _required(item)]
        choices: list[Any] = [{"enum": bare, "description": "a name, its options at their defaults"}] if bare else []
        if stage in ("part", "scan"):
            choices.append({"type": "string", "description": "path of a file, relative to the job file"})
        if stage == "scan":
            items_of_views = [{"type": "string"}, {"$ref": "#/$defs/ViewFile"}]
            views = {"type": "array", "items": {"anyOf": items_of_views}, "minItems": 1}
            choices.append(views | {"description": "files of several views, already in one frame"})
        properties[stage] = {"description": _summary(items), "anyOf": choices + mappings}
    return {
        "$schema": DIALECT,
        "$comment": f"written by damageest {version('damageest')}",
        "title": "damageest job",
        "type": "object",
        "additionalProperties": False,
        "required": ["version", "part", "scan"],
        "properties": properties,
        "$defs": dict(sorted(definitions.items())),
    }


def _required(item: Implementation) -> bool:
    return any(field.is_required() for name, field in item.cls.model_fields.items() if name != "use")


def _summary(items: tuple[Implementation, ...]) -> str:
    contract = items[0].contract if items else None
    return ((contract.__doc__ or "") if contract else "").strip().splitlines()[0]
