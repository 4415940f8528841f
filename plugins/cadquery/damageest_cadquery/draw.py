"""``python -m damageest_cadquery.draw FILE… -o PICTURE``: draws CAD files with each face in a colour of its own."""

from __future__ import annotations

import argparse
import colorsys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.geometry.edges import list_edges
from damageest_cadquery.reading.read import Model, read
from damageest_cadquery.reading.tessellate import measure_diagonal, tessellate

INNER = 0.98
"""Hue of the first face inside the part; those of the CAD get the colours between blue and green."""


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m damageest_cadquery.draw", description=__doc__)
    parser.add_argument("files", type=Path, nargs="+", help="STEP, IGES or BREP files; one picture beside the other")
    parser.add_argument("-o", "--output", type=Path, required=True, help="PNG to write")
    parser.add_argument("--size", default="520x480", help="of each, in pixels")
    parser.add_argument("--view", type=float, nargs=3, default=(1.0, -1.4, 0.9), help="direction to look from")
    chosen = parser.parse_args(arguments)
    width, height = (int(value) for value in chosen.size.split("x"))
    draw([read(path, path.suffix.lower()) for path in chosen.files], chosen.output, (width, height), chosen.view)


def draw(models: Sequence[Model], output: Path, size: tuple[int, int], view: Sequence[float]) -> None:
    """Writes a picture of each model; red to yellow are faces inside the part, blue is stock, by
    their names."""
    import pyvista as pv

    plotter = pv.Plotter(shape=(1, len(models)), off_screen=True, window_size=[size[0] * len(models), size[1]])
    for number, model in enumerate(models):
        plotter.subplot(0, number)
        mesh = tessellate(model.solids, measure_diagonal(model.solids) * 5e-4, 8.0, model.name_of)
        cells = np.column_stack([np.full(len(mesh.faces), 3), mesh.faces]).ravel()
        shape = pv.PolyData(np.asarray(mesh.vertices, np.float64), cells)
        names = mesh.names or ("",) * len(mesh.kinds)
        colours = np.array([_choose_colour(face, names[face]) for face in range(len(names))])
        shape.cell_data["colour"] = colours[mesh.faces_brep]
        plotter.add_mesh(shape, scalars="colour", rgb=True, ambient=0.25, smooth_shading=False)
        _draw_edges(plotter, mesh.vertices, mesh.faces, mesh.faces_brep)
        plotter.camera_position = [tuple(view), (0, 0, 0), (0, 0, 1)]
        plotter.reset_camera()
        plotter.camera.zoom(1.25)
    plotter.set_background("white")
    output.parent.mkdir(parents=True, exist_ok=True)
    plotter.screenshot(str(output))
    plotter.close()


def _choose_colour(face: int, name: str) -> tuple[int, int, int]:
    turn = 0.09 * (face * 0.618 % 1)
    hue, light, strength = (INNER + turn, 0.55, 0.75) if " inner " in name else (0.36 + 3 * turn, 0.68, 0.4)
    if name.startswith(("stock on ", "side of the stock")):
        hue, light, strength = 0.57 + turn / 3, 0.55 if name.startswith("stock") else 0.85, 0.65
    red, green, blue = colorsys.hls_to_rgb(hue % 1, light, strength)
    return round(255 * red), round(255 * green), round(255 * blue)


def _draw_edges(plotter: Any, vertices: Any, faces: Any, owner: Any) -> None:
    """Lines where two CAD faces meet."""
    import pyvista as pv

    edges = list_edges(faces)
    order = np.lexsort(edges.T)
    edges, of = edges[order], np.repeat(owner, 3)[order]
    between = (edges[1:] == edges[:-1]).all(axis=1) & (of[1:] != of[:-1])
    lines = edges[1:][between]
    cells = np.column_stack([np.full(len(lines), 2), lines]).ravel()
    if len(lines):
        plotter.add_mesh(pv.PolyData(vertices, lines=cells), color="#202428", line_width=1.5)


if __name__ == "__main__":
    main()
