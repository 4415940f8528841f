"""A job of version 1 is read, and means what it meant. docs/stability.md promises it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from damageest import __version__
from damageest.job import load
from damageest.job.schema import job_schema
from damageest.output.result_json import result_schema
from damageest.registry import Registry

FROZEN = Path(__file__).parent / "version_1.yaml"


def test_a_job_of_version_1_is_read(job_file: Callable[..., Path], registry: Registry) -> None:
    path = job_file().with_name("frozen.yaml")
    shutil.copy(FROZEN, path)
    job = load(path, registry)
    found = {contract.stage: stage for contract, stage in job.stages.items()}
    assert (job.method, job.tolerance, job.units) == ("surface", 0.15, "mm")
    assert found["cluster"].use == "dbscan"
    assert found["cluster"].model_dump()["neighbours"] == 8
    assert found["reconstruct"].model_dump()["neighbours"] == 20
    assert found["scan"].model_dump()["min_confidence"] == 0.5
    assert found["report"].model_dump()["points"] == 50_000


def test_the_schemas_name_the_version_that_wrote_them(registry: Registry) -> None:
    for schema in (job_schema(registry), result_schema()):
        assert schema["$comment"] == f"written by damageest {__version__}"
