"""Plots of an evaluation, each as PNG and SVG. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.errors import InputError
from damageest.evaluate._figures import axes_of, title
from damageest.evaluate._run import Row

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

    def plot(name: str, x: str, y: str, points: list[tuple[float, float]], **look: Any) -> None:
        if points:
            made.extend(_saved(folder / name, x, y, lambda axes: _against(axes, points, **look)))

    varied = axes_of(rows)
    if "noise" in varied:
        pairs = [(row["varied"]["noise"], row["surface_error"] * row["tolerance"]) for row in whole]
        plot("error_by_noise", title("noise", rows, unit), f"surface error, {unit}", pairs)
    if "points" in varied:
        pairs = [(row["varied"]["points"], row["seconds"]) for row in rows]
        plot("time_by_points", "points of the scan", "seconds", pairs, scale="log")
    if "tolerance" in varied:
        own = title("tolerance", rows, unit).endswith(unit)
        pairs = [((1 if own else row["noise"]) / row["tolerance"], row["seconds"]) for row in rows]
        plot("time_by_tolerance", f"1 / tolerance, 1/{unit}" if own else "noise / tolerance", "seconds", pairs)
    if "size" in varied:
        pairs = [(row["size"], float(row["found"] > 0 and not row["missed"])) for row in damaged if row["size"]]
        plot("found_by_depth", f"depth of the damage, {unit}", "share found", pairs, of=np.mean, dots=False)
    errors = np.array([row["surface_error"] for row in whole])
    if len(errors):

        def bars(axes: Any) -> None:
            axes.hist(errors, bins=min(40, max(10, len(errors) // 4)), color="0.6", edgecolor="0.3")
            axes.yaxis.get_major_locator().set_params(integer=True)
            axes.axvline(np.median(errors), color="C3", label=f"median {np.median(errors):.3g}")
            axes.legend()

        made.extend(_saved(folder / "errors", "surface error, tolerances", "cases", bars))
    return made


def _against(
    axes: Any,
    points: Sequence[tuple[float, float]],
    of: Callable[..., Any] = np.median,
    dots: bool = True,
    scale: str = "linear",
) -> None:
    """All cases as dots, and a line through ``of`` those with the same x."""
    x, y = np.array(points).T
    places = np.unique(x)
    if dots:
        axes.plot(x, y, "o", color="0.7", markersize=4, label="cases")
    axes.plot(places, [of(y[x == place]) for place in places], "o-", color="C0", label=of.__name__)
    axes.set_xscale(scale)
    axes.set_ylim(bottom=0)
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
