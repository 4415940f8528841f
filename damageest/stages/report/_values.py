"""Values of a result that stages may give or not: the one place where the report asks whether they are there."""

from __future__ import annotations

from typing import Any

from damageest.result import Result, Site
from damageest.stages.report._style import THIN, format_number


def show_site_interval(site: Site, unit: str) -> str:
    """The interval of a site's volume that holds the true one in 95 % of cases; empty where none was computed."""
    return _show_interval(getattr(site, "volume_95", None), unit)


def show_total_interval(result: Result) -> str:
    """As `show_site_interval`, for the volume of all accepted sites."""
    return _show_interval(getattr(result, "volume_95", None), result.units)


def list_fit(result: Result) -> list[tuple[str, str]]:
    """How well the rigid part explains the intact surface: names and values; empty where it was not asked."""
    return _list_fields(getattr(result, "fit", None))


def list_freedom(result: Result) -> list[tuple[str, str]]:
    """Motions of the part that the scan does not fix: names and values; empty where it was not asked."""
    return _list_fields(getattr(result.pose, "free", None))


def _show_interval(interval: Any, unit: str) -> str:
    if interval is None:
        return ""
    low, high = interval
    return f"{format_number(low)} … {format_number(high)}{THIN}{unit}³"


def _list_fields(value: Any) -> list[tuple[str, str]]:
    if value is None:
        return []
    if isinstance(value, (list, tuple)):
        return [("", str(item)) for item in value]
    fields = vars(value) if hasattr(value, "__dict__") else {"": value}
    shown = []
    for name, item in fields.items():
        if isinstance(item, bool) or not isinstance(item, (int, float, str)):
            continue
        shown.append((name.replace("_", " "), format_number(item) if isinstance(item, float) else str(item)))
    return shown
