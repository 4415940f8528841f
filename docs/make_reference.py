"""Writes the generated pages and sections of the documentation: contracts, the frame of each stage's page, the result.

    uv run python docs/make_reference.py

Each stage has a page in ``docs/stages/``: people write two sentences and a job, this script the frame between marks.
``damageest.job.reference`` writes the job reference; the frames have the same tables of options.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from damageest.job.reference import describe_implementation
from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS, STAGES, Contract

ROOT = Path(__file__).resolve().parents[1]
COMMAND = "uv run python docs/make_reference.py"
SHIPPED = ("damageest", "damageest-")


def main() -> None:
    registry = Registry.discover()
    for path, text in write_pages(registry).items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")


def write_pages(registry: Registry) -> dict[Path, str]:
    """Each page that is generated, or has a generated section, as it should be."""
    docs = ROOT / "docs"
    contracts = docs / "contracts.md"
    pages = {
        docs / "result.md": write_result(json.loads((ROOT / "schemas/result.schema.json").read_text(encoding="utf-8"))),
        contracts: fill(contracts.read_text(encoding="utf-8"), "contracts", "\n".join(describe_contracts())),
    }
    for stage in STAGES:
        page = docs / "stages" / f"{stage}.md"
        pages[page] = fill(page.read_text(encoding="utf-8"), "frame", "\n".join(describe_stage(stage, registry)))
    return pages


def fill(text: str, name: str, content: str) -> str:
    """A page with new content between its marks."""
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    before, _, rest = text.partition(begin)
    _, mark, after = rest.partition(end)
    if not mark:
        raise ValueError(f"the marks {begin.strip()} and {end} are missing in a page that begins: {text[:60]}")
    return f"{before}{begin}\n{content.strip()}\n\n{end}{after}"


def describe_contracts() -> Iterator[str]:
    """A section for each stage, of the docstrings of its contracts."""
    for stage in STAGES:
        yield f"\n## {stage}\n"
        for contract in (one for one in DEFAULTS if one.stage == stage):
            yield from describe_contract(contract)


def describe_contract(contract: Contract) -> Iterator[str]:
    doc = inspect.getdoc(contract) or ""
    head, _, rest = doc.partition("Args of ``run``")
    often = "site" if contract.per_site else "job"
    yield f"`{contract.__name__}`, once per {often}. {flow(head.split(chr(10) * 2)[0])}\n"
    for paragraph in head.strip().split("\n\n")[1:]:
        yield f"{flow(paragraph)}\n"
    about, _, body = rest.partition("\n")
    meanings = read_arguments(body.partition("\nReturns:")[0])
    yield f"Parameters of `run`{flow(about).rstrip(':')}:\n"
    yield "| may ask for | type | meaning |\n| --- | --- | --- |"
    shown = inspect.signature(contract.run).parameters
    for name in contract.takes():
        kind = str(shown[name].annotation).replace(" | ", "` or `")
        yield f"| `{name}` | `{kind}` | {meanings[name]} |"
    for word, said in (("Returns", "Gives"), ("Raises", "Raises")):
        if found := re.search(rf"^{word}:\n((?:    .*\n?|\n)+)", doc, re.MULTILINE):
            yield f"\n**{said}.** {flow(found[1])}"
    yield ""


def read_arguments(text: str) -> dict[str, str]:
    """The meaning of each parameter, of the indented list of a docstring."""
    found = re.findall(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", text, re.MULTILINE)
    return {name: flow(meaning) for name, meaning in found}


def describe_stage(stage: str, registry: Registry) -> Iterator[str]:
    """The generated part of a stage's page: how often it runs, its implementations, and their options."""
    contracts = [contract for contract in DEFAULTS if contract.stage == stage]
    for contract in contracts:
        often = "each site" if contract.per_site else "the job"
        yield f"`{contract.__name__}` runs once for {often}; the default is `{DEFAULTS[contract]}`."
    yield f"[Contract](../contracts.md#{stage}) for authors of plugins.\n"
    items = [item for item in registry.of(stage) if item.provider.name.startswith(SHIPPED)]
    yield "| implementation | package |\n| --- | --- |"
    for item in items:
        yield f"| [{item.name}](#{stage}-{item.name}) | {item.provider.name} |"
    for item in items:
        first, *rest = describe_implementation(item)
        yield "\n" + first.removeprefix("#")
        yield from (line.replace("#### ", "### ") for line in rest)


def write_result(schema: Mapping[str, Any]) -> str:
    """The fields of result.json as a page."""
    shared = schema["$defs"]
    lines = [
        f"<!-- Generated; do not edit. To write it anew: {COMMAND} -->",
        "",
        "# Result",
        "",
        "Every field of `result.json`, from `schemas/result.schema.json`. Lengths are in `units`, volumes in its third "
        "power, coordinates in the part's frame. Numbers that JSON lacks are `null`.",
        "",
        *describe_fields(schema),
    ]
    for name in sorted(shared):
        said = shared[name].get("description", "")
        lines += ["", f"## {name.removesuffix('Report')}", "", *([flow(said), ""] if said else [])]
        lines += describe_fields(shared[name])
    return "\n".join(lines) + "\n"


def describe_fields(model: Mapping[str, Any]) -> Iterator[str]:
    yield "| field | value | meaning |\n| --- | --- | --- |"
    for name, field in model.get("properties", {}).items():
        value = describe_value(field).replace("|", "\\|")
        yield f"| `{name}` | {value} | {flow(field.get('description', '')).replace('|', chr(92) + '|')} |"


def describe_value(field: Mapping[str, Any]) -> str:
    if "$ref" in field:
        name = str(field["$ref"]).rsplit("/", 1)[1].removesuffix("Report")
        return f"[{name}](#{name.lower()})"
    if kinds := field.get("anyOf"):
        return " or ".join(dict.fromkeys(describe_value(kind) for kind in kinds))
    if "enum" in field or "const" in field:
        return ", ".join(f"`{one}`" for one in field.get("enum", [field.get("const")]))
    if field.get("type") == "array":
        items = field.get("prefixItems") or [field.get("items", {})]
        many = f"{len(items)} of " if "prefixItems" in field else ""
        return f"list of {many}{describe_value(items[0])}" if items[0] else "list"
    if field.get("type") == "object":
        inner = field.get("additionalProperties")
        return f"mapping to {describe_value(inner)}" if isinstance(inner, Mapping) else "mapping"
    words = {"integer": "whole number", "boolean": "true or false", "string": "text", "null": "null"}
    kind = str(field.get("type", "any"))
    return words.get(kind, kind)


def flow(text: str) -> str:
    """Text on one line, with Markdown's quotes for code."""
    return " ".join(text.split()).replace("``", "`").replace("<", "&lt;")


if __name__ == "__main__":
    main()
