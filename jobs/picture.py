"""Draws the picture of the README from finished outputs: `uv run python jobs/picture.py jobs/out/gear_teeth …`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

COLOURS = ("#d1495b", "#edae49", "#00798c", "#66a182", "#8d5b9f")
HERE = Path(__file__).parent


def main() -> None:
    folders = [Path(name) for name in sys.argv[1:]] or [
        HERE / "out" / n for n in ("block_wedge", "gear_teeth", "half_torus", "four_sites")
    ]
    picture = pv.Plotter(off_screen=True, shape=(2, len(folders)), window_size=(430 * len(folders), 760), border=False)
    picture.set_background("white")
    for column, folder in enumerate(folders):
        places, sites = _scan(folder / "scan.ply")
        picture.subplot(0, column)
        for site in np.unique(sites):
            colour = "#9aa5ad" if site == 0 else COLOURS[(int(site) - 1) % len(COLOURS)]
            points = places[sites == site]
            picture.add_mesh(pv.PolyData(points), color=colour, point_size=2.0 if site == 0 else 3.5)
        _look(picture)
        picture.subplot(1, column)
        left = pv.read(folder / "undamaged.stl")
        picture.add_mesh(left, color="#c9d1d6", opacity=0.55, smooth_shading=True, split_sharp_edges=True)
        for number, path in enumerate(sorted((folder / "damage").glob("*.stl"))):
            picture.add_mesh(pv.read(path), color=COLOURS[number % len(COLOURS)])
        _look(picture)
    picture.screenshot(HERE / "picture.png")


def _scan(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Every third point of an aligned scan, and its site."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    words = [line.split() for line in head.decode().splitlines()]
    kinds = {"double": "<f8", "float": "<f4", "uchar": "u1", "int": "<i4"}
    dtype = [(line[2], kinds[line[1]]) for line in words if line[0] == "property"]
    points = np.frombuffer(body, dtype=dtype)[::3]
    return np.stack([points["x"], points["y"], points["z"]], axis=1), points["site"]


def _look(picture: pv.Plotter) -> None:
    picture.camera_position = "iso"
    picture.camera.azimuth = 25
    picture.reset_camera()
    picture.camera.zoom(1.15)


if __name__ == "__main__":
    main()
