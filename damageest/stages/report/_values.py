"""What the report says of uncertainty, fit and free motions of a result."""

from __future__ import annotations

import math

from damageest.findings import Interval, Sensor
from damageest.result import Result, Site
from damageest.stages.report._style import THIN, format_number, format_share


def show_interval(interval: Interval | None, unit: str) -> str:
    """An interval that holds the true value in 95 % of cases, as text; empty where none was computed."""
    if interval is None:
        return ""
    low, high = interval
    if not math.isfinite(high):
        return f"at least {format_number(low)}{THIN}{unit}"
    return f"{format_number(low)} … {format_number(high)}{THIN}{unit}"


def show_site_interval(site: Site, unit: str) -> str:
    """The interval of a site's volume."""
    return show_interval(site.volume_95, f"{unit}³")


def show_total_interval(result: Result) -> str:
    """The interval of the volume of all accepted sites."""
    return show_interval(result.volume_95, f"{result.units}³")


def list_fit(result: Result) -> list[tuple[str, str]]:
    """How well the rigid part explains the intact surface: names and values; empty where it was not asked."""
    fit = result.fit
    if fit is None:
        return []
    rows = [("model", f"{fit.model}; {fit.words}" if fit.words else fit.model)]
    if fit.scale:
        rows.append(("scale", f"{fit.scale:.6g} ± {fit.scale_error:.1g}"))
    if fit.amount:
        rows.append(("deformation", f"{format_number(fit.amount, 3)} {result.units}"))
    if fit.waviness:
        rows.append(("waviness", f"{format_number(fit.waviness, 3)} {result.units}"))
    return rows


def list_freedom(result: Result) -> list[tuple[str, str]]:
    """Motions of the part that the scan does not fix, in words."""
    return [("", motion.text) for motion in result.pose.free]


def list_sensor(result: Result) -> list[tuple[str, str]]:
    """Errors of the scan, and the smallest loss that it can show: names and values; empty where they are not known."""
    sensor, unit = result.sensor, result.units
    if sensor is None:
        return []
    rows = [
        ("a loss can be seen", f"deeper than {format_number(sensor.least_depth, 3)} {unit} and wider than "
         f"{format_number(sensor.least_width, 3)} {unit}"),
        ("noise of a point", f"{format_number(sensor.noise, 3)} {unit}"),
        ("errors that regions share", f"{format_number(sensor.correlated, 3)} {unit}"),
    ]  # fmt: skip
    if sensor.depth_step:
        rows.append(("step of the depth", f"{format_number(sensor.depth_step, 3)} {unit}"))
    low, high = (format_number(end, 3) for end in choose_least_ends(sensor, result.tolerance))
    return [*rows, ("colours of the layer of least depth", f"from {low} {unit}, dark, to {high} {unit}, bright")]


def choose_least_ends(sensor: Sensor, tolerance: float) -> list[float]:
    """The ends of the colours of the least depth: the tolerance, and twice that of the whole scan."""
    return [tolerance, 2 * max(sensor.least_depth, tolerance)]


def list_path(site: Site, unit: str) -> list[tuple[str, str]]:
    """The figures of a site's deposition path: names and values; empty where there is none."""
    path = site.path
    if path is None:
        return []
    share = path.unreached_volume / path.deposit_volume
    along = " along the floor" if path.layer_form == "conformal" else ""
    waits = f" and {format_number(path.wait_minutes, 3)} min of waits" if path.wait_minutes else ""
    rows = [
        ("passes", f"{path.passes} in {path.layers} layers{along}, {format_number(path.length)} {unit}"),
        ("time of the passes", f"{format_number(path.minutes, 3)} min, travel{waits} included"),
        ("not reached", f"{format_number(path.unreached_volume, 3)} {unit}³, {format_share(share)} of the deposit"),
    ]
    if path.clearance < float("inf"):
        rows.append(("nozzle stays clear by", f"{format_number(path.clearance, 2)} {unit}"))
    if path.fill is not None:
        rows.append(("filled of the rest", f"{path.fill.filled:.2%}"))
    return rows
