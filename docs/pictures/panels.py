"""What the scripts of this folder draw: bodies with their edges, scans with light and shade."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image

from damageest.artefacts import Floats, Mesh
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.views import OVERVIEWS, choose_view
from damageest.io import colours

LEFT, EDGE = "#c9d1d6", "#8a959c"
LIGHT = np.array([-0.4, 0.5, 0.8])
"""Where the light comes from: to the right of the picture, to its top, to the eye."""


def open_panels(columns: int, size: tuple[int, int]) -> pv.Plotter:
    """An empty picture of so many panels side by side, ``size`` all of them."""
    plotter = pv.Plotter(off_screen=True, shape=(1, columns), window_size=list(size), border=False)
    plotter.set_background("white")
    plotter.disable_anti_aliasing()
    plotter.ren_win.SetMultiSamples(0)
    return plotter


def save(plotter: pv.Plotter, path: Any, size: tuple[int, int], palette: int) -> None:
    """Drawn at twice the size, then made smaller, with few colours."""
    image = Image.fromarray(plotter.screenshot(return_img=True, scale=2)).resize(size, Image.Resampling.BOX)
    path.parent.mkdir(parents=True, exist_ok=True)
    image.quantize(palette, dither=Image.Dither.NONE).save(path, optimize=True)
    plotter.close()
    print(f"{path.name}: {path.stat().st_size // 1000} kB", flush=True)


def wrap(mesh: Mesh) -> Any:
    return pv.PolyData.from_regular_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces)).clean()


def add_body(plotter: pv.Plotter, mesh: Mesh, colour: str, opacity: float = 1.0, edges: bool = True) -> None:
    """A body, with its sharp edges as lines."""
    body = wrap(mesh)
    plotter.add_mesh(body, color=colour, opacity=opacity, ambient=0.15)
    lines = body.extract_feature_edges(30, boundary_edges=False, non_manifold_edges=False, manifold_edges=False)
    if edges and lines.n_cells:
        plotter.add_mesh(lines, color=EDGE, line_width=1.5)


def add_scan(
    plotter: pv.Plotter, points: Floats, colour: Floats, surface: Mesh, way: Floats, size: float = 5.0
) -> None:
    """Points (N,3) in a ``colour`` (N,3) of 0 to 1 each, lit as the ``surface`` next to them is, and seen
    from ``way`` (3,)."""
    normals = surface.face_normals[closest_on_mesh(points, surface).face]
    light = LIGHT / np.linalg.norm(LIGHT) @ np.stack(view_axes(way))
    shade = 0.55 + 0.5 * np.clip(normals @ light, 0, 1)
    cloud = pv.PolyData(points)
    cloud["rgb"] = (255 * np.clip(colour * shade[:, None], 0, 1)).astype(np.uint8)
    plotter.add_mesh(cloud, scalars="rgb", rgb=True, point_size=5, lighting=False)


def colour_sites(site: Any) -> Floats:
    """The colour (N,3) of points by the site (N,) that they lie on."""
    known = {
        number: colours.PART if number == 0 else colours.colour_site(number) for number in np.unique(site).tolist()
    }
    made = np.zeros((len(site), 3))
    for number, name in known.items():
        made[site == number] = pv.Color(name).float_rgb
    return made


def colour_distances(distance: Floats, limit: float) -> Floats:
    """The colour (N,3) of points by their signed distance (N,), from -``limit`` to ``limit``."""
    steps = np.array([pv.Color(name).float_rgb for name in colours.COOLWARM])
    at = np.clip((distance / limit + 1) / 2, 0, 1) * (len(steps) - 1)
    return np.stack([np.interp(at, np.arange(len(steps)), steps[:, channel]) for channel in range(3)], axis=1)


def look_at(plotter: pv.Plotter, vertices: Floats, way: Floats, zoom: float = 0.92) -> None:
    """All of some vertices (N,3) from a direction (3,); they fill a share ``zoom`` of the panel."""
    across, up, to_eye = view_axes(way)
    flat = np.asarray(vertices) @ np.stack([across, up, to_eye], axis=1)
    low, high = flat.min(axis=0), flat.max(axis=0)
    focus = ((low + high) / 2) @ np.stack([across, up, to_eye])
    plotter.camera.focal_point = focus
    plotter.camera.position = focus + 3 * np.linalg.norm(high - low) * to_eye
    plotter.camera.up = up
    plotter.enable_parallel_projection()
    width, height = (int(side) for side in plotter.renderer.GetSize())
    half = (high - low) / 2
    plotter.camera.parallel_scale = max(half[1], half[0] * height / width) / zoom
    plotter.renderer.ResetCameraClippingRange()


def view_axes(way: Floats) -> tuple[Floats, Floats, Floats]:
    """To the right of the picture, to its top, and to the eye, each (3,)."""
    to_eye = np.asarray(way, float) / np.linalg.norm(way)
    across = np.cross([0.0, 0.0, 1.0], to_eye)
    across /= np.linalg.norm(across)
    return across, np.cross(to_eye, across), to_eye


def choose_way(left: Mesh, surfaces: list[Mesh]) -> Floats:
    """The direction (3,) from where most of some surfaces is seen."""
    from damageest.geometry.rays import RayCaster
    from damageest.geometry.solids import concatenate_meshes

    if not surfaces:
        return np.asarray(OVERVIEWS[0])
    joined = Mesh(*concatenate_meshes(surfaces)[:2])
    return choose_view(RayCaster(left), joined, left.bounds, left.diagonal, OVERVIEWS).direction
