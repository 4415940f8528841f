"""Draws the paths of docs/paths.md layer by layer, from real runs: `uv run python docs/pictures/make_paths.py`.

It runs jobs of the repository with a path, and draws what they wrote into docs/images. A name draws that picture only.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from PIL import Image

import damageest
from damageest.artefacts import Floats
from damageest.geometry.transforms import turn_to_axis

ROOT = Path(__file__).parents[2]
OUT, IMAGES = ROOT / "jobs" / "out" / "paths", ROOT / "docs" / "images"
SIZE, DPI, PALETTE = (9.0, 2.8), 100, 48
LEANS = 5.0
"""Degrees from the mean axis of the path from which a move is drawn as tilted."""
NOZZLE = {"tip_radius": 1.0, "cone_angle": 20, "length": 90, "body_radius": 12}


@dataclass(frozen=True)
class Case:
    """A job and its path; the site, and the layers that are drawn. ``is_normal``: the tool follows the layer's normal,
    so that its tilts are not drawn."""

    job: str
    layers: tuple[int, ...]
    path: dict[str, Any] = field(default_factory=dict)
    site: int = 1
    is_normal: bool = False


CASES = {
    "planes": Case("block_path.yaml", (2, 3, 4, 6)),
    "floor": Case(
        "worn_shaft.yaml",
        (1, 2),
        {"height": 0.8, "width": 3, "standoff": 12, "axes": 5, "layers": "conformal", "nozzle": NOZZLE},
        is_normal=True,
    ),
    "tilts": Case(
        "half_torus.yaml",
        (3, 5, 7, 9),
        {"height": 1.0, "width": 2, "standoff": 6, "axes": 5, "nozzle": NOZZLE},
    ),
}


def run(name: str, case: Case) -> Path:
    """The output folder of a job with a path, which is run where that is needed."""
    job = ROOT / "jobs" / case.job
    settings: dict[str, Any] = {"report": "none", "export": {"use": "files", "paths": ["csv"]}}
    if case.path:
        settings["path"] = {"use": "layers", "feed": 600, **case.path}
    damageest.run(job, output=OUT / name, settings=settings)
    return OUT / name


def read_path(folder: Path, site: int) -> tuple[np.ndarray[Any, Any], Floats]:
    """The moves of a path, and the points (N,2) of its moves seen along its mean axis."""
    rows = np.genfromtxt(folder / "path" / f"site-{site}.csv", delimiter=",", names=True, dtype=None, encoding=None)
    return rows, np.column_stack([rows[name] for name in "xyz"])


def draw_layer(axes: Axes, rows: Any, flat: Floats, lean: Floats, layer: int) -> int:
    """One layer: each bead in a colour of its own with its start, what is tilted in red. Gives the number of beads."""
    beads = 0
    own = np.flatnonzero((rows["on"] > 0) & (rows["layer"] == layer))
    for bead in np.split(own, np.flatnonzero(np.diff(own) > 1) + 1):
        line = np.concatenate([[bead[0] - 1], bead])
        axes.plot(*flat[line].T, lw=1.1, color=plt.cm.tab10(beads % 10))
        axes.plot(*flat[line[0]], "o", ms=5, color="black")
        tilted = line[lean[line] > LEANS]
        axes.plot(*flat[tilted].T, ".", ms=2.5, color="red")
        beads += 1
    return beads


def draw(name: str, case: Case) -> None:
    folder = run(name, case)
    rows, points = read_path(folder, case.site)
    on = rows["on"] > 0
    tool = np.column_stack([rows[axis] for axis in "ijk"])
    mean = tool[on].mean(axis=0)
    mean /= np.linalg.norm(mean)
    flat = (points @ turn_to_axis(mean))[:, :2]
    lean = np.degrees(np.arccos(np.clip(tool @ mean, -1, 1)))
    if case.is_normal:
        lean[:] = 0.0
    layers = [layer for layer in case.layers if (on & (rows["layer"] == layer)).any()]
    figure, panels = plt.subplots(1, len(layers), figsize=SIZE, dpi=DPI, sharex=True, sharey=True, squeeze=False)
    for axes, layer in zip(panels.flat, layers, strict=True):
        beads = draw_layer(axes, rows, flat, lean, layer)
        axes.set_title(f"layer {layer}: {beads} {'start' if beads == 1 else 'starts'}", fontsize=9)
        axes.set_aspect("equal")
        axes.axis("off")
    figure.tight_layout(pad=0.4)
    path = IMAGES / f"path-{name}.png"
    figure.savefig(path)
    plt.close(figure)
    Image.open(path).convert("RGB").quantize(PALETTE, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path.name}: {path.stat().st_size // 1000} kB, {int(rows['layer'].max())} layers")


if __name__ == "__main__":
    for each in sys.argv[1:] or CASES:
        draw(each, CASES[each])
