"""Every number that a job may set is a number: not infinite, not ``true``, not a text. By the schema of all options."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from damageest.errors import JobError
from damageest.job import load
from damageest.job.model import Header
from damageest.registry import Registry

BAD = {"inf": float("inf"), "-inf": float("-inf"), "nan": float("nan"), "true": True, "text": "5"}
Make = Callable[[Any], Any]
Leaf = tuple[str, Make, frozenset[str]]
"""Where a number is; a value of the option with that number; the types that the place allows."""


def find_numbers(schema: Any, shared: Any, place: str = "", kinds: frozenset[str] = frozenset()) -> Iterator[Leaf]:
    """Each number below a part of a JSON schema."""
    if "$ref" in schema:
        schema = shared[schema["$ref"].rsplit("/", 1)[1]]
    if choices := schema.get("anyOf", schema.get("oneOf")):
        kinds |= {str(choice.get("type", "")) for choice in choices}
        for number, choice in enumerate(choices):
            yield from find_numbers(choice, shared, f"{place}|{number}" if len(choices) > 1 else place, kinds)
    elif schema.get("type") in ("number", "integer"):
        yield place, lambda bad: bad, kinds
    elif fixed := schema.get("prefixItems"):
        for k, item in enumerate(fixed):
            for where, make, allowed in find_numbers(item, shared, f"{place}.{k}"):
                yield (
                    where,
                    partial(_put_item, len(fixed), k, make),
                    allowed,
                )
    elif "items" in schema:
        for where, make, allowed in find_numbers(schema["items"], shared, f"{place}.0"):
            yield where, partial(_put_item, 1, 0, make), allowed
    elif "properties" in schema:
        tags = find_tags(schema["properties"])
        for name, part in schema["properties"].items():
            for where, make, allowed in find_numbers(part, shared, f"{place}.{name}"):
                yield where, partial(_put_key, tags, name, make), allowed


def _put_item(count: int, at: int, make: Make, bad: Any) -> list[Any]:
    return [make(bad) if k == at else 1 for k in range(count)]


def _put_key(tags: dict[str, Any], name: str, make: Make, bad: Any) -> dict[str, Any]:
    return {**tags, name: make(bad)}


def find_tags(properties: Any) -> dict[str, Any]:
    """The fixed values that say of which kind a mapping is: `tool: sphere`, or of several, as `keep` or `drop`, one."""
    tags = {name: part["const"] for name, part in properties.items() if "const" in part}
    either = {name: c["const"] for name, part in properties.items() for c in part.get("anyOf", ()) if "const" in c}
    return tags or dict(list(either.items())[:1])


def check(model: type[BaseModel]) -> tuple[list[str], int]:
    """The places where a bad number passes, and how many were tried."""
    schema = model.model_json_schema()
    wrong, tried = [], 0
    for place, make, allowed in find_numbers(schema, schema.get("$defs", {})):
        for name, bad in BAD.items():
            if (name == "text" and "string" in allowed) or (name == "true" and "boolean" in allowed):
                continue
            tried += 1
            try:
                model.model_validate(make(bad))
            except ValidationError as error:
                told = [e for e in error.errors() if e["input"] is bad or repr(e["input"]) == repr(bad)]
                refused = {e["type"] for e in told} & {"number", "finite_number", "literal_error"}
                if not refused:
                    wrong.append(f"{place}: {name}: {[(e['loc'], e['type']) for e in error.errors()]}")
            else:
                wrong.append(f"{place}: {name} passes")
    return wrong, tried


def test_no_option_takes_what_is_no_number(registry: Registry) -> None:
    wrong, tried = [], 0
    for item in registry.implementations:
        found, count = check(item.cls)
        wrong += [f"{item.contract.stage}: {item.name}{text}" for text in found]
        tried += count
    assert not wrong, "\n".join(wrong)
    assert tried > 800


def test_no_field_of_a_job_takes_what_is_no_number() -> None:
    wrong, tried = check(Header)
    assert not wrong, "\n".join(wrong)
    assert tried > 30


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ("cluster: {eps: true}", "5:16: cluster.eps: expected a number, not True"),
        ('cluster: {eps: "5"}', "cluster.eps: expected a number, not '5'"),
        ("cluster: {eps: .inf}", "cluster.eps: input should be a finite number, not inf"),
        ("cluster: {neighbours: yes}", "cluster.neighbours: expected a number, not 'yes'"),
        ("scan: {use: simulate, points: true}", "scan.points: expected a number, not True"),
        ("tolerance: '0.1'", "tolerance: expected"),
        ("sites: {drop: [true]}", "sites"),
    ],
)
def test_the_message_says_what_was_given(
    body: str, text: str, job_file: Callable[..., Path], registry: Registry
) -> None:
    head = "version: 1\npart: box.stl\n" + ("" if body.startswith("scan") else "scan: scan.xyz\n")
    with pytest.raises(JobError) as caught:
        load(job_file(body, head), registry)
    assert text.removeprefix("5:16: ") in str(caught.value)


def test_whole_numbers_pass_where_fractions_may_stand(job_file: Callable[..., Path], registry: Registry) -> None:
    load(job_file("cluster: {eps: 1, neighbours: 1e1}\ntolerance: 1\n"), registry)
