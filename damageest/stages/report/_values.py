"""Uncertainty, fit and free motions of a result in the report."""

from __future__ import annotations

import math

from damageest.findings import Interval, Sensor
from damageest.result import Result, Site
from damageest.stages.report._style import THIN, format_number, format_share
from damageest.stages.report._words import ENGLISH_WORDS, N_, Words


def show_interval(interval: Interval | None, unit: str, words: Words = ENGLISH_WORDS) -> str:
    """An interval that holds the true value in 95 % of cases, as text; empty where none was computed."""
    if interval is None:
        return ""
    low, high = interval
    if not math.isfinite(high):
        return words.tell("at least {low} {unit}", low=format_number(low), unit=unit)
    return f"{format_number(low)} … {format_number(high)}{THIN}{unit}"


def show_site_interval(site: Site, unit: str, words: Words = ENGLISH_WORDS) -> str:
    """The interval of a site's volume."""
    return show_interval(site.volume_95, f"{unit}³", words)


def show_total_interval(result: Result, words: Words = ENGLISH_WORDS) -> str:
    """The interval of the volume of all accepted sites."""
    return show_interval(result.volume_95, f"{result.units}³", words)


def list_fit(result: Result, words: Words) -> list[tuple[str, str]]:
    """How well the rigid part explains the intact surface: names and values; empty where this was not checked."""
    fit = result.fit
    if fit is None:
        return []
    rows = [(words.tell("model"), f"{fit.model}; {fit.words}" if fit.words else fit.model)]
    if fit.scale:
        rows.append((words.tell("scale"), f"{fit.scale:.6g} ± {fit.scale_error:.1g}"))
    if fit.amount:
        rows.append((words.tell("deformation"), f"{format_number(fit.amount, 3)} {result.units}"))
    if fit.waviness:
        rows.append((words.tell("waviness"), f"{format_number(fit.waviness, 3)} {result.units}"))
    return rows


def list_freedom(result: Result) -> list[tuple[str, str]]:
    """Motions of the part that the scan leaves free, as text."""
    return [("", motion.text) for motion in result.pose.free]


def list_sensor(result: Result, words: Words) -> list[tuple[str, str]]:
    """Errors of the scan, and the smallest loss that it can show: names and values; empty where they are not known."""
    sensor, unit, tell = result.sensor, result.units, words.tell
    if sensor is None:
        return []
    rows = [
        (tell("smallest visible loss"), tell("{depth} {unit} deep, {width} {unit} wide", unit=unit,
         depth=format_number(sensor.least_depth, 3), width=format_number(sensor.least_width, 3))),
        (tell("noise of a point"), f"{format_number(sensor.noise, 3)} {unit}"),
        (tell("correlated error"), f"{format_number(sensor.correlated, 3)} {unit}"),
    ]  # fmt: skip
    if sensor.depth_step:
        rows.append((tell("depth step"), f"{format_number(sensor.depth_step, 3)} {unit}"))
    low, high = (format_number(end, 3) for end in choose_least_ends(sensor, result.tolerance))
    colours = tell("{low} {unit} (dark) to {high} {unit} (bright)", low=low, high=high, unit=unit)
    return [*rows, (tell("colours of the layer of least depth"), colours)]


def choose_least_ends(sensor: Sensor, tolerance: float) -> list[float]:
    """The ends of the colours of the least depth: the tolerance, and twice that of the whole scan."""
    return [tolerance, 2 * max(sensor.least_depth, tolerance)]


def list_path(site: Site, unit: str, words: Words) -> list[tuple[str, str]]:
    """The figures of a site's deposition path: names and values; empty where there is none."""
    path, tell = site.path, words.tell
    if path is None:
        return []
    share = path.unreached_volume / path.deposit_volume
    conformal = path.layer_form == "conformal"
    layers = N_("{passes} in {layers} layers along the floor") if conformal else N_("{passes} in {layers} layers")
    passes = tell(layers, passes=path.passes, layers=path.layers)
    if path.wait_minutes:
        waits = tell("{minutes} min, {waits} min of waits and travel included",
                     minutes=format_number(path.minutes, 3), waits=format_number(path.wait_minutes, 3))  # fmt: skip
    else:
        waits = tell("{minutes} min, travel included", minutes=format_number(path.minutes, 3))
    missing = f"{format_number(path.unreached_volume, 3)} {unit}³"
    rows = [
        (tell("passes"), f"{passes}, {format_number(path.length)} {unit}"),
        (tell("process time"), waits),
        (tell("unreached volume"), tell("{volume}, {share} of the deposit", volume=missing, share=format_share(share))),
    ]
    if path.clearance < float("inf"):
        rows.append((tell("the nozzle stays clear by at least"), f"{format_number(path.clearance, 2)} {unit}"))
    if path.fill is not None:
        rows.append((tell("filled share of the reached volume"), f"{path.fill.filled:.2%}"))
    return rows
