"""One case: a part is scanned by a sensor, the program is run as by a person who knows nothing of either, and what it
found is judged."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from damageest_evaluate.damages import KINDS, PlacePicker
from damageest_evaluate.meter import measure_start_seconds
from damageest_evaluate.scores import measure_depth
from damageest_evaluate.sized import SIZED

from damageest.artefacts import Floats, Mesh, Part, Scan, Solid
from damageest.errors import DamageestError, InputError, StageError, describe_error
from damageest.geometry.rays import RayCaster
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.vectors import normalise
from damageest.isolation import cpu_seconds
from damageest.result import Result
from damageest.rules.notes import list_notes
from damageest.stages.scan.scanner import apply_tools
from damageest.stages.scan.simulate import Simulate
from damageest_benchmarks.realistic.sensors import SENSORS, Sensor
from damageest_benchmarks.troubles.case import describe_judgement
from damageest_benchmarks.troubles.classify import TrueState, judge, judge_error, list_pose_errors
from damageest_benchmarks.troubles.parts import TOLERANCE, make_named_part
from damageest_benchmarks.troubles.views import find_visible

SETTINGS = ("allowance=none", "tolerance=auto")
"""What the job says. The pose is not known, nor are the positions of the sensor."""
DEEP = 8.0
"""Depth of a loss in resolutions of the sensor, at least; and at least `SHARE` of the part's diagonal."""
SHARE = 0.02
LARGEST = 0.1
"""Share of the part's volume that a loss takes at most."""
ATTEMPTS = 40
CLEAN_NOISE = 1e-4
"""Noise of the clean scan with which the time is compared, as a share of the part's diagonal."""


@dataclass(frozen=True)
class RealisticCase:
    """``number``: the case's place in the whole suite, from 1. ``views``: 0 where the sensor has no positions."""

    number: int
    sensor: str
    part: str
    views: int
    damaged: bool
    points: int
    seed: int = 0
    source: str = ""

    @property
    def varied(self) -> Mapping[str, float | str]:
        return {"sensor": self.sensor}

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        return hashlib.sha256(json.dumps(vars(self)).encode()).hexdigest()[:16]

    def make_blank_row(self) -> dict[str, Any]:
        """The row of the case without a result."""
        row = {name: value for name, value in vars(self).items() if name != "source"}
        row |= {"key": self.compute_key(), "varied": dict(self.varied), "outcome": "silent", "reason": "", "error": ""}
        row |= {"refused": False, "skipped": False, "iou": None, "groups": [], "unseen": 0, "cautious": False}
        row |= {"resolution": SENSORS[self.sensor].resolution, "tolerance": None, "pose_error": None, "seen": None}
        row |= {"sites": 0, "accepted": 0, "levels": [], "codes": [], "true": 0.0, "found": 0.0, "interval": None}
        return row | {"notes": [], "seconds": 0.0, "cpu_seconds": 0.0, "clean_seconds": None}

    def run(self) -> dict[str, Any]:
        """Runs the case and gives its row."""
        return run_case(self)


def make_part(case: RealisticCase) -> Part:
    """The part at the size that suits the sensor."""
    part = make_named_part(case.part)
    scale = SENSORS[case.sensor].scale
    return replace(part, vertices=scale * part.vertices, tessellation_error=scale * part.tessellation_error)


def place_sensor(case: RealisticCase, part: Part) -> Floats:
    """Where the sensor stands (V,3): round the part on a cone 35 degrees above it for up to four views, as on a
    turntable; all round it for more. The part lies on a random side."""
    from scipy.spatial.transform import Rotation

    count, sensor = case.views, SENSORS[case.sensor]
    i = np.arange(count, dtype=np.float64)
    height: Floats
    turn: Floats
    if count <= 4:
        height, turn = np.full(count, math.sin(math.radians(35))), 2 * np.pi * i / max(count, 2)
    else:
        height, turn = 1 - (2 * i + 1) / count, np.pi * (1 + 5**0.5) * i
    across = np.sqrt(1 - height**2)
    directions = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    away = directions @ Rotation.random(random_state=np.random.default_rng([5077, case.number])).as_matrix().T
    return np.asarray(part.bounds.mean(axis=0) + max(sensor.distance, 0.75 * part.diagonal) * away)


def make_loss(case: RealisticCase, part: Part, scanners: Floats | None) -> tuple[Any, ...]:
    """Tools of one loss that the sensor sees: the first random one that is `DEEP` resolutions deep, or the deepest that
    is found on a part of thin walls. Raises LookupError where none is seen."""
    wanted = max(DEEP * SENSORS[case.sensor].resolution, SHARE * part.diagonal)
    picker = PlacePicker(part, np.random.default_rng([6133, case.number]))
    best: tuple[Any, ...] = ()
    deepest = 0.0
    for attempt in range(ATTEMPTS):
        picker.size = wanted * (15 + 5 * (attempt % 5))
        with contextlib.suppress(LookupError, StageError):
            tools = tuple(KINDS[SIZED[(case.number + attempt) % len(SIZED)]](picker))
            left, damage, _ = apply_tools(part, tools)
            if damage is None or damage.volume > LARGEST * part.volume or not is_seen(part, left, damage, scanners):
                continue
            depth = measure_depth(damage, part)
            if depth > deepest:
                best, deepest = tools, depth
            if depth >= wanted:
                return tools
    if not best:
        raise LookupError(f"none of {ATTEMPTS} random losses lies on skin that is seen")
    return best


def is_seen(part: Part, left: Mesh, damage: Solid, scanners: Floats | None) -> bool:
    """Whether three quarters of the skin of the loss, and of its inside, are seen."""
    if scanners is None:
        return True
    points, face = sample_by_area(damage, 1000, np.random.default_rng(17))
    normals = normalise(damage.cross[face])
    outside = find_visible(RayCaster(part), part, points, normals, scanners).any(axis=1)
    inside = find_visible(RayCaster(left), left, points, -normals, scanners).any(axis=1)
    return bool((outside | inside).mean() > 0.75)


def make_scanner(case: RealisticCase, tools: tuple[Any, ...], scanners: Floats | None) -> Simulate:
    """The virtual scanner with the errors of the sensor."""
    sensor = SENSORS[case.sensor]
    options = dict(sensor.options)
    if case.views < 2:
        options.pop("misplaced", None)
    placed = {} if scanners is None else {"scanners": scanners.tolist(), "reference_distance": sensor.distance}
    common = {"damage": tools, "points": case.points, "pose": "random", "seed": 31 * case.number + case.seed}
    return Simulate.model_validate({**options, **placed, **common, "positions_known": False})


def run_case(case: RealisticCase) -> dict[str, Any]:
    """Runs a case, and the clean scan that its time is compared with. ``skipped`` where no loss fits the part."""
    row, part = case.make_blank_row(), make_part(case)
    scanners = place_sensor(case, part) if case.views else None
    try:
        tools = make_loss(case, part, scanners) if case.damaged else ()
        scan = make_scanner(case, tools, scanners).run(part.unit, part)
    except (LookupError, StageError) as error:
        return row | {"skipped": True, "error": describe_error(error)}
    clean_options = {"damage": tools, "points": case.points, "noise": CLEAN_NOISE * part.diagonal, "pose": "random"}
    clean = Simulate.model_validate({**clean_options, "seed": case.number}).run(part.unit, part)
    measure_start_seconds()
    before = cpu_seconds()
    with contextlib.suppress(StageError, InputError):
        run_job(part, clean)
        row["clean_seconds"] = cpu_seconds() - before
    row |= _measure_run(part, scan, SENSORS[case.sensor])
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in row.items()
    }


def run_job(part: Part, scan: Scan) -> Result:
    """The result of a scan without its truth."""
    import damageest

    return damageest.run({"version": 1}, part=part, scan=Scan(scan.points, unit=scan.unit), settings=SETTINGS)


def _measure_run(part: Part, scan: Scan, sensor: Sensor) -> dict[str, Any]:
    """The fields of a row that come from the run."""
    assert scan.truth is not None
    damage, pose = scan.truth.damage, scan.truth.T_part_scan
    row: dict[str, Any] = {"true": damage.volume if damage else 0.0}
    start, before = time.perf_counter(), cpu_seconds()
    try:
        result = run_job(part, scan)
    except (StageError, InputError) as error:
        message = describe_error(error)
        row |= describe_judgement(judge_error(message)) | {"iou": None, "error": message}
        return row | {"seconds": time.perf_counter() - start, "cpu_seconds": cpu_seconds() - before}
    except DamageestError as error:  # the job of the evaluation itself is at fault
        raise RuntimeError(f"the job of the evaluation is not valid: {error}") from error
    row |= {"seconds": time.perf_counter() - start, "cpu_seconds": cpu_seconds() - before}
    row |= {
        "tolerance": result.tolerance,
        "pose_error": min(error for error, _ in list_pose_errors(part, result.pose, pose)),
        "seen": None if result.coverage is None else result.coverage.seen,
        "sites": len(result.sites),
        "accepted": sum(site.accepted for site in result.sites),
        "levels": [site.verdict.level for site in result.sites],
        "codes": sorted({reason.code for site in result.sites for reason in site.verdict.reasons}),
        "found": sum(site.damage.volume for site in result.sites if site.accepted),
        "interval": result.volume_95 and [value if math.isfinite(value) else None for value in result.volume_95],
        "notes": list_notes(result),
    }
    return row | describe_judgement(judge(result, TrueState(part, damage, pose, TOLERANCE * sensor.resolution)))
