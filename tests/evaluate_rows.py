"""Rows of cases, without running them."""

from __future__ import annotations

from typing import Any

from damageest_evaluate.case import DamageCase


def row(**figures: Any) -> dict[str, Any]:
    """The row of a case with a good result, with some ``figures`` replaced."""
    case = DamageCase("cuboid", 5, "pit", 0.2, scanner={"noise": 0.05, "points": 1000})
    well = {"iou": 0.99, "volume_error": -0.01, "surface_error": 0.2, "pose_error": 0.01, "found": 1, "missed": 0}
    cost = {"seconds": 2.0, "cpu_seconds": 3.0, "libigl_seconds": 0.5, "start_seconds": 1.0, "megabytes": 100.0}
    stages = {"stage_seconds": {"align": 1.0, "enclose": 0.5}, "stage_megabytes": {"align": 100, "enclose": 90}}
    return case.make_blank_row() | well | {"sites": 1} | cost | stages | figures


MISSED = {"iou": 0.0, "volume_error": -1.0, "surface_error": None, "found": 0, "missed": 1, "sites": 0}
INTACT = {"size": 0, "iou": 1.0, "volume_error": None, "surface_error": None, "found": 0, "sites": 0}
