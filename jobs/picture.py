"""Draws the pictures of the documentation from finished outputs: `uv run python jobs/picture.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

COLOURS = ("#d1495b", "#edae49", "#00798c", "#66a182", "#8d5b9f")
HERE = Path(__file__).parent
IMAGES = HERE.parent / "docs" / "images"
CLOSE = {
    "stock_flanks": ((25.0, 0.0, 7.0), (1.0, 0.7, 0.9), 4.0),
    "worn_bore": ((0.0, 2.0, 8.0), (0.5, -0.9, 1.6), 2.4),
}
"""Where to look at, from which side, and how closely."""


def main() -> None:
    damages([HERE / "out" / name for name in ("block_wedge", "gear_teeth", "half_torus", "four_sites")])
    stock([HERE / "out" / name for name in ("stock_uniform", "stock_flanks", "worn_bore")])


def damages(folders: list[Path]) -> None:
    """The aligned scans with the points of each site, and the damage volumes in what is left."""
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
    picture.screenshot(IMAGES / "damages.png")


def stock(folders: list[Path]) -> None:
    """What is left in grey, and on it the deposits, coloured by how far they stand beyond the nominal surface."""
    picture = pv.Plotter(off_screen=True, shape=(1, len(folders)), window_size=(560 * len(folders), 520), border=False)
    picture.set_background("white")
    for column, folder in enumerate(folders):
        picture.subplot(0, column)
        whole = pv.merge([pv.read(folder / "undamaged.stl"), pv.read(folder / "damage.stl")])
        left = pv.read(folder / "undamaged.stl")
        picture.add_mesh(left, color="#c9d1d6", smooth_shading=True, split_sharp_edges=True)
        deposits = pv.merge([pv.read(path) for path in sorted((folder / "deposit").glob("*.stl"))])
        deposits = deposits.triangulate().subdivide_adaptive(max_edge_len=0.3, max_n_passes=8)
        proud = deposits.compute_implicit_distance(whole)
        proud["stock, mm"] = np.abs(proud["implicit_distance"]).round(3)
        bar = {"color": "black", "fmt": "%.1f", "n_labels": 3, "width": 0.5, "position_x": 0.25, "position_y": 0.02}
        title = f"stock, mm{' ' * column}"  # bars of one title would be one bar
        picture.add_mesh(proud, scalars="stock, mm", cmap="YlOrRd", scalar_bar_args={**bar, "title": title})
        _look(picture)
        if folder.name in CLOSE:
            focus, way, zoom = CLOSE[folder.name]
            picture.view_vector(way, (0, 0, 1))
            picture.camera.focal_point = focus
            picture.camera.zoom(zoom)
    picture.screenshot(IMAGES / "stock.png")


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
