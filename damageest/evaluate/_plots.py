"""Plots of an evaluation, each as PNG and SVG. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.errors import InputError
from damageest.evaluate._figures import axes_of, crossed, title
from damageest.evaluate._run import Row

Point = tuple[float, float]

SIZE = (6.0, 4.0)
"""Inches."""


def require() -> None:
    """Raises InputError where matplotlib is missing; for before the runs, not after."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise InputError(
            "the plots need matplotlib, which is not installed\n  try: pip install 'damageest[evaluate]', or --no-plots"
        ) from None


def draw(rows: Sequence[Row], unit: str, folder: Path) -> list[Path]:
    """The histogram of surface errors, and a plot for each of noise, points, tolerance and depth that was varied."""
    rows = [row for row in rows if not row["skipped"]]
    damaged = [row for row in rows if row["size"] != 0]
    whole = [row for row in damaged if row.get("surface_error") is not None]
    made: list[Path] = []

    def plot(name: str, x: str, y: str, some: Sequence[Row], point: Callable[[Row], Point], **look: Any) -> None:
        lines: dict[str, list[Point]] = {}
        for row in some:
            lines.setdefault(str(row["varied"].get("way", "")), []).append(point(row))
        if lines:
            made.extend(_saved(folder / name, x, y, lambda axes: _against(axes, lines, **look)))

    varied = axes_of(rows)
    if "noise" in varied:

        def error(row: Row) -> Point:
            return row["varied"]["noise"], row["surface_error"] * row["tolerance"]

        plot("error_by_noise", title("noise", rows, unit), f"surface error, {unit}", whole, error)
    if "points" in varied:
        plot("time_by_points", "points of the scan", "seconds", rows, _by_points, scale="log")
    if "tolerance" in varied:
        own = title("tolerance", rows, unit).endswith(unit)

        def time(row: Row) -> Point:
            return (1 if own else row["noise"]) / row["tolerance"], row["seconds"]

        name = f"1 / tolerance, 1/{unit}" if own else "noise / tolerance"
        plot("time_by_tolerance", name, "seconds", rows, time, scale="log")
    if "size" in varied:

        def hit(row: Row) -> Point:
            return row["size"], float(row["found"] > 0 and not row["missed"])

        deep = [row for row in damaged if row["size"]]
        plot("found_by_depth", f"depth of the damage, {unit}", "share found", deep, hit, of=np.mean, dots=False)
    if "way" in varied:

        def cost(axes: Any) -> None:
            _ways(axes, {way: [row for row in whole if row["varied"]["way"] == way] for way in varied["way"]})

        made.extend(_saved(folder / "error_by_time", "seconds", "surface error, tolerances", cost))
    errors = np.array([row["surface_error"] for row in whole])
    if len(errors):

        def bars(axes: Any) -> None:
            axes.hist(errors, bins=min(40, max(10, len(errors) // 4)), color="0.6", edgecolor="0.3")
            axes.yaxis.get_major_locator().set_params(integer=True)
            axes.axvline(np.median(errors), color="C3", label=f"median {np.median(errors):.3g}")
            axes.legend()

        made.extend(_saved(folder / "errors", "surface error, tolerances", "cases", bars))
    return made


def _by_points(row: Row) -> Point:
    return row["varied"]["points"], row["seconds"]


def _against(
    axes: Any,
    lines: Mapping[str, Sequence[Point]],
    of: Callable[..., Any] = np.median,
    dots: bool = True,
    scale: str = "linear",
) -> None:
    """All cases as dots, and for each way a line through ``of`` those with the same x. A log scale is one of both
    axes, so that a power of x is a straight line."""
    for number, (way, points) in enumerate(lines.items()):
        x, y = np.array(points).T
        places = np.unique(x)
        if dots:
            axes.plot(x, y, "o", color="0.7", markersize=4, label="" if number else "cases")
        axes.plot(places, [of(y[x == place]) for place in places], "o-", color=f"C{number}", label=way or of.__name__)
    axes.set_xscale(scale)
    axes.set_yscale(scale)
    if scale == "linear":
        axes.set_ylim(bottom=0)
    axes.legend()


def _ways(axes: Any, ways: Mapping[str, Sequence[Row]]) -> None:
    """What accuracy costs: a line for each implementation, through the medians of its settings."""
    lines: dict[str, list[Point]] = {}
    for way, rows in ways.items():
        for group in crossed(rows).values():
            x, y = (float(np.median([row[name] for row in group])) for name in ("seconds", "surface_error"))
            lines.setdefault(way.split()[0], []).append((x, y))
    for number, (name, points) in enumerate(lines.items()):
        axes.plot(*np.array(sorted(points)).T, "o-", color=f"C{number}", label=name)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.legend()


def _saved(stem: Path, x: str, y: str, content: Callable[[Any], None]) -> list[Path]:
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context({"svg.hashsalt": "damageest"}):
        figure = Figure(SIZE, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        content(axes)
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        axes.grid(alpha=0.3)
        paths = [stem.with_suffix(".png"), stem.with_suffix(".svg")]
        figure.savefig(paths[0], dpi=150)
        figure.savefig(paths[1], metadata={"Date": None})  # the same plot, the same bytes
    return paths
