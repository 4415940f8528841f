"""Pictures and windows of output folders, drawn by VTK through PyVista."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from damageest.artefacts import Mesh
from damageest.errors import StageError
from damageest.geometry.rays import RayCaster
from damageest.geometry.solids import concatenate_meshes
from damageest.geometry.views import DIRECTIONS, OVERVIEWS, choose_view
from damageest.io import colours
from damageest.io.files import check_output_file, moved_into_place
from damageest.isolation import Limits, call_isolated
from damageest.output.folder import OutputFolder
from damageest.output.graphics import describe_failure

Look = Literal["damage", "points", "deviation", "deposit", "stock", "path"]
LOOKS: tuple[Look, ...] = ("damage", "points", "deviation", "deposit", "stock", "path")
"""damage: damage volumes in what is left; points: the scan, each site in its colour; deviation: the scan by signed
distance; deposit: deposits on what is left; stock: those, coloured by their height over the nominal surface; path:
passes coloured by layer, what they do not reach in red, and the nozzle with its beam where it is tightest."""
Side = Literal["iso", "x", "y", "z"]
SIDES = {"iso": (-1.0, -1.0, 0.8), "x": (1.0, 0.0, 0.0), "y": (0.0, -1.0, 0.0), "z": (0.0, 0.0, 1.0)}
LEFT, EDGE, GROUND = "#c9d1d6", "#8a959c", "white"
MOST_POINTS = 300_000
TUBE = 0.2
"""Radius of a pass that is drawn, in bead widths."""


@dataclass(frozen=True)
class Picture:
    """What to draw: a column for each of the ``folders``, with its site of ``sites`` (0: all of the part), a row for
    each of the ``looks``; ``size``: width and height of one of them in pixels; ``side``: from where, None: from where
    the site is seen best."""

    folders: tuple[OutputFolder, ...]
    sites: tuple[int, ...]
    looks: tuple[Look, ...] = ("damage",)
    side: Side | None = None
    size: tuple[int, int] = (900, 700)


def draw_picture(picture: Picture, path: Path) -> None:
    """Draws into a PNG file, in a process of its own: VTK ends the process where there is no OpenGL. An earlier picture
    stays where it fails.

    Raises StageError where it fails, InputError where a folder cannot be read, JobError where the file cannot be
    written.
    """
    check_output_file(path, "--output")
    for folder in picture.folders:
        _ = folder.scan  # what is wrong with the files is said here, and not by the other process
    with moved_into_place(path, "--output") as scratch:
        arguments = {"picture": picture, "path": str(scratch)}
        try:
            # VTK's messages say the same in many lines; they are the cause of the error, for --debug
            call_isolated(draw_here, arguments, worker="picture", limits=Limits(seconds=0), show=False, stays=False)
        except Exception as error:  # VTK and PyVista share none
            raise describe_failure(error) from error


def open_window(folder: OutputFolder, site: int) -> None:
    """Opens a window with the layers of a result. Raises StageError where there is no display, or PyVista is not
    installed."""
    import os
    import sys

    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise StageError(
            "there is no display for a window here",
            f"{shlex.join(['damageest', 'picture', str(folder.folder), '-o', 'picture.png'])}, or open "
            f"{folder.folder / 'report.html'} in a browser",
            code="missing",
        )
    try:
        import pyvista as pv

        plotter = pv.Plotter(title=f"damageest: {folder.content['name']}")
    except Exception as error:
        raise describe_failure(error, "the window could not be opened") from error
    plotter.set_background(GROUND)
    actors = _add_layers(plotter, folder)
    for k, (name, group) in enumerate(actors.items()):
        _add_switch(plotter, name, group, 10 + 34 * k)
    _place_camera(plotter, folder, site, None)
    plotter.add_axes(viewport=(0.85, 0.0, 1.0, 0.15))
    plotter.show()


def draw_here(picture: Picture, path: str) -> None:
    """As `draw_picture`, in this process."""
    import pyvista as pv
    from PIL import Image

    rows, columns = len(picture.looks), len(picture.folders)
    size = [picture.size[0] * columns, picture.size[1] * rows]
    plotter = pv.Plotter(off_screen=True, shape=(rows, columns), window_size=size, border=False)
    plotter.set_background(GROUND)
    # Drawn at twice the size, then made smaller: VTK's own smoothing ("ssaa") draws translucent faces in no order.
    plotter.disable_anti_aliasing()
    plotter.ren_win.SetMultiSamples(0)
    for row, look in enumerate(picture.looks):
        for column, (folder, site) in enumerate(zip(picture.folders, picture.sites, strict=True)):
            plotter.subplot(row, column)
            plotter.enable_depth_peeling(8)
            _add_look(plotter, folder, site, look, " " * (row * columns + column))
            _place_camera(plotter, folder, site, picture.side)
    large = Image.fromarray(plotter.screenshot(return_img=True, scale=2))
    large.resize((size[0], size[1]), Image.Resampling.BOX).save(path)


def _add_look(plotter: Any, folder: OutputFolder, site: int, look: Look, unique: str) -> None:
    if look in ("points", "deviation"):
        _add_scan(plotter, folder, look, unique, 7.0 if site else 3.0)
        return
    left = folder.read_solid("undamaged") or folder.read_mesh("skin.ply")
    if left is not None:
        opacity = 0.55 if look == "damage" else 1.0
        body = _wrap(left)
        plotter.add_mesh(body, color=LEFT, opacity=opacity)
        edges = body.extract_feature_edges(30, boundary_edges=False, non_manifold_edges=False, manifold_edges=False)
        if edges.n_cells:
            plotter.add_mesh(edges, color=EDGE, line_width=1.5)
    if look == "path":
        _add_paths(plotter, folder, site)
        return
    for number in folder.site_numbers:
        body = None if look == "damage" else folder.read_solid("deposit", number)
        body = body or folder.read_solid("damage", number)  # which is what to deposit where there is no allowance
        if body is None:
            continue
        if look == "stock":
            _add_stock(plotter, folder, body, unique)
        else:
            plotter.add_mesh(_wrap(body), color=colours.colour_site(number) if look == "damage" else colours.DEPOSIT)


def _add_paths(plotter: Any, folder: OutputFolder, site: int) -> None:
    """Adds the path of a site, 0 for those of all."""
    import pyvista as pv

    for number in [site] if site else folder.site_numbers:
        path = folder.read_path(number)
        if path is not None:
            ends = np.flatnonzero(path.on)
            places = np.stack([path.points[ends - 1], path.points[ends]], axis=1).reshape(-1, 3)
            lines = np.column_stack([np.full(len(ends), 2), np.arange(2 * len(ends)).reshape(-1, 2)])
            passes = pv.PolyData(places, lines=lines.ravel())
            passes.cell_data["layer"] = path.layer[ends]
            tubes = passes.tube(radius=TUBE * path.width, n_sides=12)
            plotter.add_mesh(tubes, scalars="layer", cmap="viridis", show_scalar_bar=False)
        for kind, look in (
            ("unreached", {"color": colours.UNREACHED}),
            ("tool", {"color": colours.NOZZLE, "opacity": 0.45}),
        ):
            mesh = folder.read_mesh(f"path/site-{number}.{kind}.ply")
            if mesh is not None:
                plotter.add_mesh(_wrap(mesh), **look)


def _add_stock(plotter: Any, folder: OutputFolder, deposit: Mesh, unique: str) -> None:
    skin = folder.read_mesh("skin.ply")
    fine = _wrap(deposit).clean().subdivide_adaptive(max_edge_len=deposit.diagonal / 60, max_n_passes=8)
    if skin is None:
        plotter.add_mesh(fine, color=colours.DEPOSIT)
        return
    from damageest.geometry.distance import signed_distance

    title = f"stock, {folder.unit}{unique}"  # bars of one title would be one bar
    fine[title] = np.maximum(signed_distance(np.asarray(fine.points, np.float64), skin)[0], 0)
    bar = {"color": "black", "fmt": "%.1f", "n_labels": 3, "width": 0.5, "position_x": 0.25, "position_y": 0.02}
    plotter.add_mesh(fine, scalars=title, cmap="YlOrRd", scalar_bar_args={**bar, "title": title})


def _add_scan(plotter: Any, folder: OutputFolder, look: Look, unique: str, size: float) -> Any:
    import pyvista as pv

    scan = folder.scan
    if scan is None:
        return None
    every = max(len(scan.points) // MOST_POINTS, 1)
    points, site, distance = scan.points[::every], scan.site[::every], scan.distance[::every]
    if look == "deviation":
        cloud, limit = pv.PolyData(points), 3 * float(folder.content["tolerance"])
        title = f"deviation, {folder.unit}{unique}"
        cloud[title] = distance
        bar = {"color": "black", "title": title, "width": 0.5, "position_x": 0.25, "position_y": 0.02, "n_labels": 3}
        return plotter.add_mesh(
            cloud, scalars=title, cmap=colours.DEVIATION, clim=(-limit, limit), point_size=size, scalar_bar_args=bar
        )
    for number in np.unique(site):
        colour = colours.PART if number == 0 else colours.colour_site(int(number))
        own = pv.PolyData(points[site == number])
        plotter.add_mesh(own, color=colour, point_size=size if number == 0 else 1.5 * size)
    return None


def _add_layers(plotter: Any, folder: OutputFolder) -> dict[str, list[Any]]:
    """The layers of the report, as actors by the layer's name; those that are hidden at first are at the end."""
    import pyvista as pv

    found: dict[str, list[Any]] = {}

    def add(name: str, data: Any, **look: Any) -> None:
        if data is not None:
            mesh = data if isinstance(data, pv.DataSet) else _wrap(data)
            found.setdefault(name, []).append(plotter.add_mesh(mesh, **look))

    skin = folder.read_mesh("skin.ply") or folder.read_solid("undamaged")
    add("part", skin, color=colours.PART, opacity=0.25)
    for site in folder.site_numbers:
        add("damage volumes", folder.read_solid("damage", site), color=colours.colour_site(site))
    for item in folder.content["surplus"]:
        add("surplus", folder.read_solid("surplus", item["id"]), color=colours.SURPLUS)
    add("unseen skin", folder.read_mesh("unseen.ply"), color=colours.UNSEEN, opacity=0.45)
    shown = set(found)
    for site in folder.site_numbers:
        add("inner damage surfaces", folder.read_surface(site), color=colours.colour_site(site))
        add("deposits", folder.read_solid("deposit", site), color=colours.DEPOSIT, opacity=0.75)
    if folder.scan is not None and (actor := _add_scan(plotter, folder, "deviation", "", 3.0)) is not None:
        found["scan"] = [actor, *plotter.scalar_bars.values()]
        for site in folder.site_numbers:
            own = folder.scan.points[folder.scan.site == site]
            if len(own):
                add("damage points", pv.PolyData(own), color=colours.colour_site(site), point_size=4)
    for name in found.keys() - shown:
        for actor in found[name]:
            actor.visibility = False
    return found


def _add_switch(plotter: Any, name: str, actors: Sequence[Any], height: int) -> None:
    def switch(on: bool) -> None:
        for actor in actors:
            actor.visibility = on

    on = bool(actors[0].visibility)
    plotter.add_checkbox_button_widget(switch, value=on, position=(10, height), size=24, color_on="#2f86d6")
    plotter.add_text(name, position=(42, height), font_size=9, color="black")


def _place_camera(plotter: Any, folder: OutputFolder, site: int, side: Side | None) -> None:
    """The camera onto the part or onto a site: from a side, or without one from where most of the damage is seen."""
    way, up = np.array(SIDES[side or "iso"]), (0.0, 1.0, 0.0) if side == "z" else (0.0, 0.0, 1.0)
    left = folder.read_solid("undamaged")
    numbers = [site] if site else folder.site_numbers
    surfaces = [mesh for number in numbers if (mesh := folder.read_surface(number)) is not None]
    bounds = next((np.array(told["bounds"]) for told in folder.content["sites"] if told["id"] == site), None)
    if side is None and left is not None and surfaces:
        vertices, faces, _ = concatenate_meshes(surfaces)
        box = left.bounds if bounds is None else bounds
        choice = OVERVIEWS if bounds is None else DIRECTIONS
        view = choose_view(RayCaster(left), Mesh(vertices, faces), box, left.diagonal, choice)
        way, up = view.direction, tuple(view.up)
    if bounds is None:
        plotter.view_vector(way, up)
        plotter.reset_camera()
        plotter.camera.zoom(1.05)
        return
    half = 0.8 * np.ptp(bounds, axis=0)
    near = np.array([bounds.mean(axis=0) - half, bounds.mean(axis=0) + half])
    plotter.view_vector(way, up, bounds=near.T.ravel().tolist())


def _wrap(mesh: Mesh) -> Any:
    import pyvista as pv

    return pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces).clean()
