"""A result in PyVista's window or notebook view."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from damageest.artefacts import Mesh
from damageest.errors import InputError, StageError, describe_missing_library
from damageest.io import colours

if TYPE_CHECKING:
    from damageest.result import Result

LEFT = "#c9d1d6"
MOST_POINTS = 100_000


def make_plotter(result: Result, site: int | None, shown: bool) -> Any:
    """A ``pyvista.Plotter`` with what is left of the part, the damage volumes, and the scan by signed distance.

    ``site``: look at this one; None: at all of the part. ``shown``: it will be shown at once. Raises StageError
    where pyvista is not installed or there is no display, InputError where there is no such site.
    """
    try:
        import pyvista as pv
    except ImportError as error:
        raise describe_missing_library(error) or error from error

    has_display = sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    plotter = pv.Plotter(off_screen=not has_display)
    if shown and not has_display and not plotter.notebook:
        raise StageError(
            "there is no display for a window here",
            "show=False, and `plotter.screenshot('picture.png')`; or a notebook",
            code="missing",
        )
    plotter.set_background("white")
    left = result.undamaged or result.part
    plotter.add_mesh(_wrap(left), color=LEFT, opacity=0.5)
    bounds = None
    for one in result.sites:
        plotter.add_mesh(_wrap(one.damage), color=colours.colour_site(one.id), label=f"site {one.id}")
        bounds = one.damage.bounds if one.id == site else bounds
    if site is not None and bounds is None:
        known = ", ".join(str(one.id) for one in result.sites) or "none"
        raise InputError(f"there is no site {site}; there are: {known}")
    every = max(1, -(-len(result.aligned.points) // MOST_POINTS))
    cloud, limit = pv.PolyData(np.asarray(result.aligned.points[::every])), 3 * result.tolerance
    title = f"deviation, {result.units}"
    cloud[title] = result.deviation.distance[::every]
    plotter.add_mesh(cloud, scalars=title, cmap=colours.DEVIATION, clim=(-limit, limit), point_size=3)
    plotter.add_axes()
    if bounds is not None:
        half = 0.8 * np.ptp(bounds, axis=0)
        plotter.reset_camera(bounds=np.stack([bounds.mean(0) - half, bounds.mean(0) + half], axis=1).ravel().tolist())
    return plotter


def _wrap(mesh: Mesh) -> Any:
    import pyvista as pv

    return pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
