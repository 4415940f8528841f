"""The files of a result that are not meshes: result.json and job.yaml."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from damageest.job import yamlfile
from damageest.job.model import Job, to_plain
from damageest.output.provenance import build_provenance, seal
from damageest.output.result_json import build_report
from damageest.result import Result
from damageest.stages.export import ExportedFiles


def describe_result(result: Result, target: Path, written: ExportedFiles) -> dict[str, Any]:
    """The content of result.json, its paths relative to ``target``, where it will stand."""
    return build_report(result, written, lambda path: to_plain(Path(path), target))


def describe_job(job: Job, target: Path) -> str:
    """The content of job.yaml, its paths relative to ``target``, where it will stand."""
    return yamlfile.write(job.to_values(target))


def write_report(result: Result, job: Job, folder: Path, target: Path, written: ExportedFiles) -> None:
    """Writes result.json and job.yaml into ``folder``, their paths relative to ``target``, where they will stand."""
    content = describe_result(result, target, written)
    (folder / "job.yaml").write_text(describe_job(job, target), encoding="utf-8")
    content["provenance"] = build_provenance(job, folder, target)
    content["provenance"]["sha256"] = seal(content)
    (folder / "result.json").write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
