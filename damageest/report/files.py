"""The files of a result that are not meshes: result.json and job.yaml."""

from __future__ import annotations

import json
from pathlib import Path

from damageest.job import yamlfile
from damageest.job.model import Job, to_plain
from damageest.report.result_json import build_report
from damageest.result import Result
from damageest.stages.export import ExportedFiles


def write_report(result: Result, job: Job, folder: Path, target: Path, written: ExportedFiles) -> None:
    """Writes result.json and job.yaml into ``folder``, their paths relative to ``target``, where they will stand."""
    content = build_report(result, written, lambda path: to_plain(Path(path), target))
    (folder / "result.json").write_text(json.dumps(content, indent=1, allow_nan=False) + "\n")
    (folder / "job.yaml").write_text(yamlfile.write(job.to_values(target)))
