"""Plots of an evaluation, each as PNG and as SVG. They need matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest_evaluate.figures import collect_axes, group_by_combination, make_title
from damageest_evaluate.processes import Row

Point = tuple[float, float]

SIZE = (6.0, 4.0)
"""Inches."""


def draw_plots(rows: Sequence[Row], unit: str, folder: Path) -> list[Path]:
    """Draws a histogram of surface errors, and a plot for each of noise, points, tolerance, depth and way if varied.

    Gives the paths of the files.
    """
    rows = [row for row in rows if not row["skipped"]]
    damaged = [row for row in rows if row["size"] != 0]
    complete = [row for row in damaged if row.get("surface_error") is not None]
    paths: list[Path] = []

    def plot(name: str, x: str, y: str, chosen: Sequence[Row], point: Callable[[Row], Point], **style: Any) -> None:
        lines: dict[str, list[Point]] = {}
        for row in chosen:
            lines.setdefault(str(row["varied"].get("way", "")), []).append(point(row))
        if lines:
            paths.extend(_save_plot(folder / name, x, y, lambda axes: _plot_lines(axes, lines, **style)))

    varied = collect_axes(rows)
    if "noise" in varied:

        def to_error_by_noise(row: Row) -> Point:
            return row["varied"]["noise"], row["surface_error"] * row["tolerance"]

        plot("error_by_noise", make_title("noise", rows, unit), f"surface error, {unit}", complete, to_error_by_noise)
    if "points" in varied:
        plot("time_by_points", "points of the scan", "seconds", rows, _to_time_by_points, scale="log")
    if "tolerance" in varied:
        in_unit = make_title("tolerance", rows, unit).endswith(unit)

        def to_time_by_tolerance(row: Row) -> Point:
            return (1 if in_unit else row["noise"]) / row["tolerance"], row["seconds"]

        name = f"1 / tolerance, 1/{unit}" if in_unit else "noise / tolerance"
        plot("time_by_tolerance", name, "seconds", rows, to_time_by_tolerance, scale="log")
    if "size" in varied:

        def is_found(row: Row) -> Point:
            return row["size"], float(row["found"] > 0 and not row["missed"])

        deep = [row for row in damaged if row["size"]]
        plot("found_by_depth", f"depth of the damage, {unit}", "share found", deep, is_found, of=np.mean, dots=False)
    if "way" in varied:

        def plot_cost(axes: Any) -> None:
            _plot_ways(axes, {way: [row for row in complete if row["varied"]["way"] == way] for way in varied["way"]})

        paths.extend(_save_plot(folder / "error_by_time", "seconds", "surface error, tolerances", plot_cost))
    errors = np.array([row["surface_error"] for row in complete])
    if len(errors):

        def plot_histogram(axes: Any) -> None:
            axes.hist(errors, bins=min(40, max(10, len(errors) // 4)), color="0.6", edgecolor="0.3")
            axes.yaxis.get_major_locator().set_params(integer=True)
            axes.axvline(np.median(errors), color="C3", label=f"median {np.median(errors):.3g}")
            axes.legend()

        paths.extend(_save_plot(folder / "errors", "surface error, tolerances", "cases", plot_histogram))
    return paths


def _to_time_by_points(row: Row) -> Point:
    return row["varied"]["points"], row["seconds"]


def _plot_lines(
    axes: Any,
    lines: Mapping[str, Sequence[Point]],
    of: Callable[..., Any] = np.median,
    dots: bool = True,
    scale: str = "linear",
) -> None:
    """Draws all cases as dots, and for each way a line through ``of`` (as the median) of the cases with the same x.

    A log scale applies to both axes, so that a power of x is a straight line.
    """
    for number, (way, points) in enumerate(lines.items()):
        x, y = np.array(points).T
        values = np.unique(x)
        if dots:
            axes.plot(x, y, "o", color="0.7", markersize=4, label="" if number else "cases")
        axes.plot(values, [of(y[x == value]) for value in values], "o-", color=f"C{number}", label=way or of.__name__)
    axes.set_xscale(scale)
    axes.set_yscale(scale)
    if scale == "linear":
        axes.set_ylim(bottom=0)
    axes.legend()


def _plot_ways(axes: Any, ways: Mapping[str, Sequence[Row]]) -> None:
    """Draws error over time: a line for each implementation, through the medians of its settings."""
    lines: dict[str, list[Point]] = {}
    for way, rows in ways.items():
        for group in group_by_combination(rows).values():
            x, y = (float(np.median([row[name] for row in group])) for name in ("seconds", "surface_error"))
            lines.setdefault(way.split()[0], []).append((x, y))
    for number, (name, points) in enumerate(lines.items()):
        axes.plot(*np.array(sorted(points)).T, "o-", color=f"C{number}", label=name)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.legend()


def _save_plot(stem: Path, x: str, y: str, content: Callable[[Any], None]) -> list[Path]:
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
        figure.savefig(paths[1], metadata={"Date": None})  # without a date, the same plot has the same bytes
    return paths
