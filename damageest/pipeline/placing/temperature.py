"""The step about the temperature of the part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, Scan
from damageest.job.scanner import Temperature
from damageest.pipeline.placing.form import divide_scan
from damageest.pipeline.steps import step
from damageest.trust.interval.scanner import REFERENCE


@step(gives=("scan", "thermal_scale", "scan_centre"))
def correct_temperature(scan: Scan, temperature: Temperature | None) -> tuple[Scan, float, Floats]:
    """Brings the lengths of the scan to 20 °C, at which the drawing holds, where the job says how warm the part was.
    The middle of the scan stays where it is, and does so where the scale is corrected later."""
    centre = np.asarray(scan.points.mean(axis=0)) if len(scan.points) else np.zeros(3)
    if temperature is None:
        return scan, 1.0, centre
    scale = 1 + temperature.expansion * (temperature.part - REFERENCE)
    text = (
        f"lengths were divided by {scale:.7g}: the part was at {temperature.part:g} °C, its coefficient of expansion "
        f"is {temperature.expansion:.4g} 1/K, and the drawing holds at {REFERENCE:g} °C"
    )
    return replace(divide_scan(scan, scale, centre), notes=(*scan.notes, text)), scale, centre
