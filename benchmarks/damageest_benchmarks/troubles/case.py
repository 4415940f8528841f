"""One case of the suite, from the trouble to the judgement, as a row of values that JSON can hold."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from damageest import hookimpl
from damageest.artefacts import Floats, Pose, Scan
from damageest.errors import DamageestError, InputError, StageError, describe_error
from damageest.geometry.transforms import invert_pose
from damageest.isolation import cpu_seconds
from damageest.registry import Registry
from damageest.result import Result
from damageest_benchmarks.troubles.classify import (
    Judgement,
    TrueState,
    judge,
    judge_error,
    measure_seen_error,
)
from damageest_benchmarks.troubles.kinds import TROUBLES
from damageest_benchmarks.troubles.scene import Scanning, TroubleScene


@dataclass(frozen=True)
class TroubleCase:
    """The inputs of one case. Equal cases give equal scans.

    ``number``: the case's place in the whole suite, from 1. ``source``: digest of the code.
    """

    kind: str
    part: str
    seed: int
    number: int
    pose: str
    views: int
    positions: bool
    amount: float
    points: int
    source: str = ""
    varied: Mapping[str, float | str] = field(default_factory=dict)

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        values = {name: value for name, value in vars(self).items() if name != "varied"}
        return hashlib.sha256(json.dumps(values).encode()).hexdigest()[:16]

    def make_blank_row(self) -> dict[str, Any]:
        """The row of a case that has no result yet."""
        row = {name: value for name, value in vars(self).items() if name not in ("source", "varied")}
        row |= {"key": self.compute_key(), "outcome": "silent", "reason": "", "iou": None, "unseen": 0}
        row |= {
            "cautious": False,
            "refused": False,
            "skipped": False,
            "error": "",
            "codes": [],
            "groups": [],
            "sites": 0,
        }
        row |= {"accepted": 0, "true_volume": 0.0, "found_volume": 0.0, "seen": None, "seen_reported": None}
        return row | {"seen_error": None, "seconds": 0.0, "cpu_seconds": 0.0, "step_seconds": 0.0}

    def run(self) -> dict[str, Any]:
        """As `run_case`."""
        return run_case(self)


class StageClock:
    """Adds up the processor time of the stages of a run. What is left of the run's time are its steps."""

    def __init__(self) -> None:
        self.stage_seconds = 0.0
        self._start = 0.0

    @hookimpl
    def damageest_before_stage(self, stage: str) -> None:
        """Takes the time before a stage."""
        self._start = cpu_seconds()

    @hookimpl
    def damageest_after_stage(self, stage: str) -> None:
        self.stage_seconds += cpu_seconds() - self._start


def make_scene(case: TroubleCase) -> TroubleScene:
    """The case's scene. Raises StageError or LookupError where the trouble is not possible on the part."""
    scanning = Scanning(case.part, case.seed, case.views, case.points, case.amount, case.number)
    return TROUBLES[case.kind].make(scanning)


def make_scan(case: TroubleCase, scene: TroubleScene) -> tuple[Scan, Floats]:
    """The scan in the scanner's frame, and the true T_part_scan (4,4)."""
    pose = scene.shift
    if case.pose == "unknown":
        from scipy.spatial.transform import Rotation

        rng = np.random.default_rng([6007, case.seed, case.number])
        pose = np.eye(4)
        pose[:3, :3] = Rotation.random(random_state=rng).as_matrix()
        pose[:3, 3] = rng.uniform(-2, 2, 3) * scene.part.diagonal
    viewed = case.positions and scene.view is not None
    view = scene.view.astype(np.int32) if viewed and scene.view is not None else None
    scan = Scan(scene.points, unit=scene.part.unit, viewpoints=scene.scanners if viewed else None, view=view)
    return scan.move(pose), invert_pose(Pose(pose))


def run_case(case: TroubleCase) -> dict[str, Any]:
    """Runs a case and gives its row. If the trouble is not possible on the part, ``skipped`` is True."""
    import damageest

    row = case.make_blank_row()
    try:
        scene = make_scene(case)
    except (LookupError, StageError) as error:
        return row | {"skipped": True, "error": describe_error(error)}
    scan, pose = make_scan(case, scene)
    row["true_volume"] = scene.damage.volume if scene.damage else 0.0
    row["seen"] = scene.seen
    scanning = Scanning(case.part, case.seed, amount=case.amount)
    settings = ["allowance=none", f"tolerance={scanning.tolerance:.6g}"]
    settings += ["align=none"] if case.pose == "known" else []
    settings += scene.settings
    clock = StageClock()
    registry = Registry.discover([clock])
    start, cpu_start = time.perf_counter(), cpu_seconds()
    try:
        result = damageest.run({"version": 1}, part=scene.part, scan=scan, settings=settings, registry=registry)
    except (StageError, InputError) as error:
        message = describe_error(error)
        row["seconds"] = time.perf_counter() - start
        return row | describe_judgement(judge_error(message)) | {"iou": None, "error": message}
    except DamageestError as error:  # the job of the evaluation itself is at fault
        raise RuntimeError(f"the job of case {case.number} is not valid: {error}") from error
    row["seconds"], row["cpu_seconds"] = time.perf_counter() - start, cpu_seconds() - cpu_start
    row["step_seconds"] = row["cpu_seconds"] - clock.stage_seconds
    row |= _describe_result(result, scene)
    state = TrueState(scene.part, scene.damage, pose if scene.has_pose else None, scanning.tolerance, scene.deform)
    row |= describe_judgement(judge(result, state))
    return {name: None if isinstance(v, float) and math.isnan(v) else v for name, v in row.items()}


def describe_judgement(judgement: Judgement) -> dict[str, Any]:
    """The fields of a row that come from the judgement; an open end of an interval is None."""
    groups = [vars(one) | {"high": one.high if math.isfinite(one.high) else None} for one in judgement.groups]
    return vars(judgement) | {"groups": groups}


def _describe_result(result: Result, scene: TroubleScene) -> dict[str, Any]:
    """The fields of a row that come from the result."""
    reported = None if result.coverage is None else result.coverage.seen
    return {
        "codes": sorted({reason.code for site in result.sites for reason in site.verdict.reasons}),
        "sites": len(result.sites),
        "accepted": sum(site.accepted for site in result.sites),
        "found_volume": sum(site.damage.volume for site in result.sites if site.accepted),
        "seen_reported": reported,
        "seen_error": measure_seen_error(result.coverage, scene.seen),
    }
