"""The reference of the job file as Markdown, read off the models: every field, stage, implementation and option.

`uv run python -m damageest.job.reference > docs/job-reference.md` writes it for the packages installed here.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from damageest.job.model import Header
from damageest.registry import Implementation, Registry
from damageest.registry.contracts import DEFAULTS, STAGES, SURFACE_ONLY, Contract

COMMAND = "uv run python -m damageest.job.reference > docs/job-reference.md"
"""The command that writes the page anew."""

HEAD = f"""\
<!-- Generated; do not edit. To write it anew: {COMMAND} -->

# Job reference

Every field, stage, implementation and option of a job file. This page is generated from the code. For the plugins that
are installed on your machine, `damageest stages STAGE NAME` shows the same, and `damageest schema` prints the JSON
Schema.

How to read it:

- A stage is given as `stage: name`, or as `stage: {{use: name, option: value}}`. Without `use`, the default is taken.
- `--set stage.option=value` on the command line overrides one option, `--set field=value` one field.
- *Default*: "required": the job must give the option. "–": empty; the meaning says what is done then.
- *Unit*: "job": the job's `units`. "tolerances": times the job's `tolerance`.
- Paths are relative to the folder of the job file. Numbers must be finite.
"""

_UNITS = (
    (r"its length does not matter", "direction"),
    (r"in the job's unit|in the part's frame|in part coordinates", "job"),
    (r"in tolerances or point spacings", "tolerances or point spacings"),
    (r"in tolerances", "tolerances"),
    (r"\bdegrees\b", "degrees"),
    (r"\bGiB\b", "GiB"),
    (r"in cells", "cells"),
    (r"in units of `spacing`", "`spacing`"),
    (r"in distances between points", "point spacings"),
    (r"\bshare of\b", "share, 0 to 1"),
)
"""Words of a description to the unit that they state; the first match is taken."""

_BOUNDS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
_WORDS = {"integer": "whole number", "boolean": "true or false", "string": "text", "object": "mapping"}


def write_reference(registry: Registry) -> str:
    """The reference as a Markdown page, for the implementations of a registry."""
    lines = [HEAD, *_describe_fields(registry)]
    for stage in STAGES:
        lines += _describe_stage(stage, registry)
    return "\n".join(lines).rstrip() + "\n"


def _describe_fields(registry: Registry) -> Iterator[str]:
    schema = Header.model_json_schema()
    schema["properties"]["method"]["enum"] = list(registry.methods())
    yield "## Fields that are not stages\n"
    shared = schema.get("$defs", {})
    yield from _table(schema, shared, "job")
    yield ""
    for name, inner in shared.items():
        yield f"#### {_name_model(name, inner)} {{: #{_anchor('job', name)} }}\n"
        yield f"{_flow(inner.get('description', ''))}\n"
        yield from _table(inner, shared, "job")
        yield ""


def _describe_stage(stage: str, registry: Registry) -> Iterator[str]:
    contracts = [contract for contract in DEFAULTS if contract.stage == stage]
    yield f"## {stage}\n"
    for contract in contracts:
        yield f"{_unwrap(contract).splitlines()[0]} {_describe_when(contract)}\n"
    for item in registry.of(stage):
        yield from describe_implementation(item)


def _describe_when(contract: Contract) -> str:
    """How often a contract's implementations run, and on which route."""
    often = "Runs once for each site" if contract.per_site else "Runs once per job"
    return f"{often}{', with `method: surface` only' if contract in SURFACE_ONLY else ''}."


def describe_implementation(item: Implementation) -> Iterator[str]:
    """The lines of an implementation: its docstring, its package, and its options as tables."""
    default = DEFAULTS[item.contract] == item.name
    yield f"### {item.contract.stage}: {item.name}\n"
    facts = [f"Package `{item.provider.name}`."]
    alone = len([contract for contract in DEFAULTS if contract.stage == item.contract.stage]) == 1
    if default:
        facts.append("The default." if alone else f"The default of `method: {item.method}`.")
    elif not alone:
        facts.append(f"Belongs to `method: {item.method}`.")
    if item.cls.reads:
        facts.append(f"Reads {', '.join(f'`{suffix}`' for suffix in item.cls.reads)}.")
    yield f"{_unwrap(item.cls)}\n"
    yield " ".join(facts) + "\n"
    schema = item.cls.model_json_schema()
    schema["properties"].pop("use")
    if not schema["properties"]:
        yield "No options.\n"
        return
    shared = schema.get("$defs", {})
    own = f"{item.contract.stage}-{item.name}"
    yield from _table(schema, shared, own)
    yield ""
    for name, inner in shared.items():
        yield f"#### {_name_model(name, inner)} {{: #{_anchor(own, name)} }}\n"
        yield f"{_flow(inner.get('description', ''))}\n"
        yield from _table(inner, shared, own)
        yield ""


def _table(schema: Mapping[str, Any], shared: Mapping[str, Any], own: str) -> Iterator[str]:
    """The options of a model as a table. ``own`` begins the anchors of the models that its values are."""
    yield "| option | value | default | unit | meaning |"
    yield "| --- | --- | --- | --- | --- |"
    required = schema.get("required", [])
    for name, option in schema["properties"].items():
        said = option.get("description", "")
        default = "required" if name in required else _show(option.get("default"))
        cells = (f"`{name}`", _describe_value(option, shared, own), default, _find_unit(said), _flow(said))
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _describe_value(value: Mapping[str, Any], shared: Mapping[str, Any], own: str) -> str:
    """Kind, choices and range of a value, from its JSON Schema."""
    if "$ref" in value:
        name = str(value["$ref"]).rsplit("/", 1)[1]
        return f"[{_name_model(name, shared[name])}](#{_anchor(own, name)})"
    kinds = value.get("anyOf") or value.get("oneOf")
    if kinds:
        told = [_describe_value(kind, shared, own) for kind in kinds if kind.get("type") != "null"]
        return " or ".join(dict.fromkeys(told))
    if "const" in value or "enum" in value:
        return ", ".join(_show(choice) for choice in value.get("enum", [value.get("const")]))
    if value.get("type") == "array":
        return _describe_list(value, shared, own)
    if value.get("format") in ("path", "file-path"):
        return "path"
    if "examples" in value:
        return "text, such as " + ", ".join(_show(each) for each in value["examples"])
    kind = str(value.get("type", "any"))
    text = _WORDS.get(kind, kind)
    bounds = " and ".join(f"{sign} {value[key]}" for key, sign in _BOUNDS.items() if key in value)
    return f"{text} {bounds}".strip()


def _name_model(name: str, model: Mapping[str, Any]) -> str:
    """A model's name, or what its fixed value is where it is one of several kinds: ``tool: box``."""
    fixed = [f"{key}: {option['const']}" for key, option in model["properties"].items() if "const" in option]
    return fixed[0] if fixed else name


def _describe_list(value: Mapping[str, Any], shared: Mapping[str, Any], own: str) -> str:
    fixed = value.get("prefixItems")
    if not fixed:
        inner = _describe_value(value.get("items", {}), shared, own)
        return f"list of: {inner}" + (", not empty" if value.get("minItems", 0) > 0 else "")
    if "prefixItems" in fixed[0]:
        return f"{len(fixed)} lists of {len(fixed[0]['prefixItems'])} numbers"
    told = [_describe_value(inner, shared, own) for inner in fixed]
    bounds = told[0].removeprefix("number").strip()
    if all(each.startswith("number") for each in told) and len(set(told)) == 1:
        return f"{len(told)} numbers" + (f", each {bounds}" if bounds else "")
    return "[" + ", ".join(told) + "]"


def _find_unit(description: str) -> str:
    return next((unit for words, unit in _UNITS if re.search(words, description)), "")


def _show(value: Any) -> str:
    """A value as a job file has it."""
    if value is None or value in ("", [], ()):
        return "–"
    return f"`{value if isinstance(value, str) else json.dumps(value)}`"


def _unwrap(cls: type) -> str:
    """A docstring, each of its paragraphs on one line."""
    return "\n\n".join(_flow(part) for part in (inspect.getdoc(cls) or "").split("\n\n"))


def _flow(text: str) -> str:
    """Text on one line, with Markdown's quotes for code, and braces and angles as they are."""
    return " ".join(text.split()).replace("``", "`").replace("<", "&lt;")


def _anchor(own: str, name: str) -> str:
    return f"{own}-{name}".lower().replace("_", "-")


if __name__ == "__main__":
    print(write_reference(Registry.discover()), end="")
