"""Measurements as Markdown tables, with date, versions and machine."""

from __future__ import annotations

import datetime
import os
import platform
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any


def format_markdown(lines: Sequence[Sequence[str]], names: int = 1) -> str:
    """A Markdown table; the first line is the head. All columns after the first ``names`` are aligned to the right."""
    rule = ["---"] * names + ["---:"] * (len(lines[0]) - names)
    return "\n".join("| " + " | ".join(words) + " |" for words in (lines[0], rule, *lines[1:]))


def describe_measurement(what: str) -> str:
    """``what``, if any, followed by the date, the versions and the machine of the measurement."""
    measured = collect_versions()
    libraries = ", ".join(f"{name} {number}" for name, number in measured["versions"].items())
    return f"{what}{'. ' if what else ''}Measured {measured['date']}: {libraries}; {measured['machine']}."


def collect_versions() -> dict[str, Any]:
    """Today's date, the versions of the libraries that compute, and the machine."""
    names = ("damageest", "numpy", "pyvista", "manifold3d", "libigl")
    return {
        "date": datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        "versions": {"Python": platform.python_version(), **{name: version(name) for name in names}},
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
    }
