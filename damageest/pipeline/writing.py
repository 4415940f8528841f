"""Steps round the stages `export` and `report`: what result.json and job.yaml say, and what the stages wrote."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Reason
from damageest.errors import StageError
from damageest.io.forms import FORM, MeasuredForm, hash_scan, mark_scan, write_form
from damageest.io.section_files import write_section_files
from damageest.output.files import describe_job, describe_result, write_report
from damageest.pipeline.engine import Engine
from damageest.pipeline.state import JobState
from damageest.pipeline.steps import step
from damageest.result import Result
from damageest.rules.notes import make_notes, rank_notes
from damageest.stages.export import ExportedFiles
from damageest.stages.report import Report


@step(gives="written")
def write_measured(written: ExportedFiles, result: Result, folder: Path) -> ExportedFiles:
    """Writes the tables and drawings of sections, and the form of an adapted part."""
    files = write_section_files(folder, result.sections, result.tolerance, result.units)
    return replace(written, files=(*written.files, *files, *keep_form(result, folder)))


def keep_form(result: Result, folder: Path) -> tuple[str, ...]:
    """Writes how an adapted part differs from the part as designed, for jobs on other parts of its type."""
    adapted = result.adapted
    if adapted is None or adapted.field is None or adapted.seen is None or not adapted.designed:
        return ()
    form = MeasuredForm(
        field=adapted.field,
        seen=adapted.seen,
        left=np.zeros(len(adapted.seen)) if adapted.left is None else adapted.left,
        reach=adapted.reach,
        unit=adapted.part.unit,
        tolerance=result.tolerance,
        part=adapted.designed,
        scan=hash_scan(result.aligned),
        marks=mark_scan(result.aligned),
    )
    write_form(folder / FORM, form)
    return (FORM,)


@step(gives=("result", "content", "job_text"))
def describe_output(
    engine: Engine, result: Result, written: ExportedFiles, target: Path
) -> tuple[Result, Mapping[str, Any], str]:
    """Adds to the result what the export says and all stages so far; gives the content of result.json and job.yaml."""
    if written.warnings:
        result = replace(result, warnings=rank_notes((*result.warnings, *make_notes("export", written.warnings))))
    result = replace(result, stages=tuple(engine.records), steps=tuple(engine.steps))
    return result, describe_result(result, target, written), describe_job(engine.job, target)


@step(gives=("result", "written"), reads=("written",), calls=(Report,))
def show_result(engine: Engine, state: JobState) -> tuple[Result, ExportedFiles]:
    """Makes the report. One that fails is a warning: the result is more than its pictures."""
    result, written = state.result, state.written
    try:
        done = engine.call(Report, state).reported
    except StageError as error:
        text = f"{error.args[0]} (the run went on without a report)"
        if error.extra:
            text = f"report.html was not written: {error.message}"
        warning = Reason("report", text, remedy=error.remedy)
        return replace(result, warnings=(*result.warnings, warning)), written
    result = replace(result, stages=tuple(engine.records), steps=tuple(engine.steps))
    return result, replace(written, files=(*written.files, *done.files), notes=(*written.notes, *done.notes))


@step()
def write_output(engine: Engine, result: Result, written: ExportedFiles, folder: Path, target: Path) -> None:
    """Writes result.json and job.yaml."""
    write_report(result, engine.job, folder, target, written)
