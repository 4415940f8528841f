"""Accuracy, time and memory of every implementation of every stage, with all other stages at their defaults.

The scans of the jobs are simulated, so that the truth is known; else a job's own result stands for it. Each run has a
process of its own, so that its peak memory can be measured.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from damageest_evaluate.memory import PeakMemory
from damageest_evaluate.processes import run_in_process
from damageest_evaluate.scores import score

from damageest.errors import DamageestError, Fault, JobError
from damageest.isolation import cpu_seconds
from damageest.registry import Implementation, Registry
from damageest.registry.contracts import STAGES
from damageest_benchmarks.matrix_job import MatrixJob, load_scene, make_settings, prepare_matrix_job

DEFAULT = "default of each stage"
"""What the cells are named that no implementation was chosen for."""


@dataclass(frozen=True)
class MatrixCell:
    """One implementation on one job.

    ``refused``: the reason if there is no result (``iou`` is NaN), or none for some sites. ``flagged``: the result's
    own checks failed. ``volume``: found for true. ``stage_seconds``: time in the stage; ``seconds``: processor
    time of the run, without the stages up to the sites where another cell computed them; ``megabytes``: peak memory.
    """

    stage: str
    use: str
    job: str
    iou: float
    flagged: bool = False
    refused: str = ""
    volume: float = float("nan")
    stage_seconds: float = float("nan")
    seconds: float = float("nan")
    megabytes: float = float("nan")


def run_matrix(
    jobs: Sequence[Path],
    registry: Registry,
    stages: Sequence[str] = (),
    workers: int = 1,
    timeout: float = 300,
    tell: Callable[[MatrixCell], None] = lambda cell: None,
) -> list[MatrixCell]:
    """All cells, ordered by stage, implementation and job. Raises JobError for an invalid job or an unknown stage."""
    if unknown := [stage for stage in stages if stage not in STAGES]:
        raise JobError([Fault(f"no stage '{unknown[0]}'; there are: {', '.join(STAGES)}")], "matrix")
    with tempfile.TemporaryDirectory(prefix="damageest-matrix-") as folder:
        items = [item for stage in STAGES if not stages or stage in stages for item in registry.of(stage)]
        with ThreadPoolExecutor(workers) as pool:
            places = [Path(folder) / str(k) for k in range(len(jobs))]
            scenes = list(pool.map(prepare_matrix_job, jobs, [registry] * len(jobs), places))
            pairs = [(item, scene) for item in (None, *items) for scene in scenes]
            futures = [pool.submit(_run_cell, item, scene, timeout) for item, scene in pairs]
            cells = []
            for future in futures:
                cells.append(future.result())
                tell(cells[-1])
    return cells


def _run_cell(item: Implementation | None, scene: MatrixJob, timeout: float) -> MatrixCell:
    """One implementation, or the default of each stage (None), on one job, run in a process of its own."""
    name = (item.contract.stage if item else "", item.name if item else DEFAULT, scene.name)
    settings = make_settings(item, scene)
    if isinstance(settings, str):
        return MatrixCell(*name, float("nan"), refused=settings)
    case = {"folder": str(scene.folder), "stage": name[0], **settings}
    row = run_in_process(run_one, {"case": case}, timeout)
    return MatrixCell(*name, **row) if isinstance(row, dict) else MatrixCell(*name, float("nan"), refused=row)


def run_one(case: dict[str, Any]) -> dict[str, Any]:
    """The fields of a cell, from a run in this process."""
    with PeakMemory() as memory:
        return _run_measured(case, memory)


def _run_measured(case: dict[str, Any], memory: PeakMemory) -> dict[str, Any]:
    import damageest

    folder = Path(case["folder"])
    part, scan, lost, pose = load_scene(folder, np.array(case["moved"]))
    own = Path(tempfile.mkdtemp(dir=folder))
    shutil.copytree(folder / "early", own, dirs_exist_ok=True)
    start = cpu_seconds()
    row: dict[str, Any] = {"iou": float("nan")}
    given: dict[str, Any] = {} if case["own_part"] else {"part": part}
    given |= {} if case["own_scan"] else {"scan": scan}
    try:
        settings = [] if case["stage"] == "report" else ["report=none"]
        result = damageest.run(case["job"], output=own, settings=settings, **given)
    except DamageestError as error:
        row["refused"] = _shorten_reason(str(error))
        return row | {"seconds": cpu_seconds() - start}
    finally:
        shutil.rmtree(own)
    row["seconds"] = cpu_seconds() - start
    row["stage_seconds"] = sum(record.seconds for record in result.stages if record.stage == case["stage"])
    row["megabytes"] = memory.take_peak()
    solids = [site.damage for site in result.sites]
    row["iou"] = score(part, solids, lost, result.tolerance, result.pose.T_part_scan, pose).iou
    row["volume"] = result.damage_volume / lost.volume
    row["flagged"] = result.status != "ok" or not all(site.evidence.consistent for site in result.sites)
    if result.failures:
        row["refused"] = _shorten_reason(result.failures[0])
    return row


def _shorten_reason(text: str) -> str:
    """The message without its remedy, and without stage and implementation, which the table's row names."""
    return text.splitlines()[0].split(": ", 2)[-1]
