"""The committed schemas are the ones the code gives, and they say of files what the code says."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from damageest.job import yamlfile
from damageest.job.schema import job_schema
from damageest.output.result_json import result_schema
from damageest.registry import Registry
from tests.needs import PLUGINS, import_or_skip, needs_plugin

ROOT = Path(__file__).parents[2]


def committed(name: str) -> Any:
    return json.loads((ROOT / "schemas" / f"{name}.schema.json").read_text())


def own(registry: Registry) -> Registry:
    """What this repository provides, whatever else is installed here."""
    plugins = [tomllib.loads(path.read_text()) for path in (ROOT / "plugins").glob("*/pyproject.toml")]
    names = {"damageest", *(plugin["project"]["name"] for plugin in plugins)}
    kept = tuple(item for item in registry.implementations if item.provider.name in names)
    return dataclasses.replace(registry, implementations=kept)


@needs_plugin(*PLUGINS)
def test_job_schema_is_current(registry: Registry) -> None:
    current = json.loads(json.dumps(job_schema(own(registry))))
    remedy = "run: uv run damageest schema job > schemas/job.schema.json"
    assert committed("job") == current, remedy


def test_result_schema_is_current() -> None:
    current = json.loads(json.dumps(result_schema()))
    remedy = "run: uv run damageest schema result > schemas/result.schema.json"
    assert committed("result") == current, remedy


@pytest.mark.parametrize("path", sorted((ROOT / "jobs").glob("*.yaml")), ids=lambda path: path.stem)
def test_example_jobs_fit_the_schema(path: Path) -> None:
    jsonschema = import_or_skip("jsonschema")
    jsonschema.Draft202012Validator(committed("job")).validate(yamlfile.read(path)[0])


@pytest.mark.parametrize(
    "change",
    [
        {"clutser": "dbscan"},
        {"cluster": "dbscam"},
        {"cluster": {"use": "dbscan", "neighbors": 5}},
        {"units": "parsec"},
        {"tolerance": -1},
        {"version": 2},
        {"scan": 3},
    ],
)
def test_the_schema_refuses_what_the_code_refuses(change: dict[str, Any]) -> None:
    jsonschema = import_or_skip("jsonschema")
    job = {"version": 1, "part": "a.stl", "scan": "b.ply", **change}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(committed("job")).validate(job)
