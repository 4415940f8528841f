"""Every implementation of every stage on given jobs, all other stages as the job has them: accuracy, time and memory.

The jobs' scans are simulated, so that the truth is known; each run has a process of its own, for its memory's sake.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Part, Scan, Solid, Truth
from damageest.errors import DamageestError, Fault, JobError
from damageest.evaluate._run import MARK, apart
from damageest.evaluate._scene import Scene, prepared, settings_for
from damageest.evaluate.scores import score
from damageest.registry import Implementation, Registry
from damageest.registry.contracts import STAGES


@dataclass(frozen=True)
class Cell:
    """One implementation on one job. ``refused`` says why there is no result (``iou`` NaN) or none for some sites;
    ``doubtful``: the result itself says that it is. ``stage_seconds`` are the stage's own, ``seconds`` the run's,
    ``megabytes`` the process's peak."""

    stage: str
    use: str
    job: str
    iou: float
    doubtful: bool = False
    refused: str = ""
    stage_seconds: float = float("nan")
    seconds: float = float("nan")
    megabytes: float = float("nan")


def matrix(
    jobs: Sequence[Path],
    registry: Registry,
    stages: Sequence[str] = (),
    workers: int = 1,
    timeout: float = 300,
    tell: Callable[[Cell], None] = lambda cell: None,
) -> list[Cell]:
    """All cells, by stage, implementation and job. Raises JobError for a job at fault or one whose truth is unknown."""
    if unknown := [stage for stage in stages if stage not in STAGES]:
        raise JobError([Fault(f"no stage '{unknown[0]}'; there are: {', '.join(STAGES)}")], "matrix")
    with tempfile.TemporaryDirectory(prefix="damageest-matrix-") as place:
        scenes = [prepared(path, registry, Path(place) / str(k)) for k, path in enumerate(jobs)]
        items = [item for stage in STAGES if not stages or stage in stages for item in registry.of(stage)]
        with ThreadPoolExecutor(workers) as pool:
            pairs = [(item, scene) for item in items for scene in scenes]
            futures = [pool.submit(_cell, item, scene, timeout) for item, scene in pairs]
            cells = []
            for future in futures:
                cells.append(future.result())
                tell(cells[-1])
    return cells


def _cell(item: Implementation, scene: Scene, timeout: float) -> Cell:
    """Runs one implementation on one job in a process of its own."""
    name = (item.contract.stage, item.name, scene.name)
    settings = settings_for(item, scene)
    if isinstance(settings, str):
        return Cell(*name, float("nan"), refused=settings)
    case = {"folder": str(scene.folder), "stage": item.contract.stage, "use": item.name, **settings}
    row = apart("damageest.evaluate.matrix", case, timeout)
    return Cell(*name, **row) if isinstance(row, dict) else Cell(*name, float("nan"), refused=row)


def run_one(case: dict[str, Any]) -> dict[str, Any]:
    """The row of one run, in this process."""
    import resource

    import damageest

    folder = Path(case["folder"])
    data = np.load(folder / "scene.npz")
    part = Part(data["vertices"], data["faces"], unit=str(data["unit"]))
    truth = Truth(Solid(data["lost"], data["lost_faces"]), data["pose"])
    start = time.perf_counter()
    row: dict[str, Any] = {"iou": float("nan")}
    given: dict[str, Any] = {} if case["own_part"] else {"part": part}
    pose = truth.T_part_scan
    if not case["own_scan"]:
        move = np.array(case["moved"])
        given["scan"] = Scan(data["points"], unit=str(data["unit"])).move(move)
        pose = pose @ np.linalg.inv(move)
    try:
        found = damageest.run(case["job"], output=folder / "out" if case["stage"] == "export" else False, **given)
    except DamageestError as error:
        row["refused"] = _reason(str(error))
        return row | {"seconds": time.perf_counter() - start}
    row["seconds"] = time.perf_counter() - start
    row["stage_seconds"] = sum(record.seconds for record in found.stages if record.stage == case["stage"])
    row["megabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    solids = [site.damage for site in found.sites]
    row["iou"] = score(part, solids, truth.damage, found.tolerance, found.pose.T_part_scan, pose).iou
    row["doubtful"] = found.status != "ok" or not all(site.evidence.consistent for site in found.sites)
    if found.failures:
        row["refused"] = _reason(found.failures[0])
    return row


def _reason(text: str) -> str:
    """The message alone, without the stage and implementation, which its row names, and the remedy."""
    return text.splitlines()[0].split(": ", 2)[-1]


if __name__ == "__main__":
    print(MARK + json.dumps(run_one(json.loads(sys.argv[1]))), flush=True)
