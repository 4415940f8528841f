"""Draws the pictures of docs/bad-scan.md from real runs: `uv run python docs/pictures/make_bad_scan.py`.

It runs the jobs of jobs/bad_scans, whose scans are virtual and seeded, and draws what they wrote into docs/images.
A name, or several, draws these pictures only.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from PIL import Image

import damageest
from damageest.artefacts import Floats, Mesh
from damageest.errors import DamageestError
from damageest.geometry.distance import signed_distance
from damageest.io import colours
from damageest.io.meshes import read_mesh
from damageest.output.folder import OutputFolder, open_output

ROOT = Path(__file__).parents[2]
JOBS, IMAGES = ROOT / "jobs" / "bad_scans", ROOT / "docs" / "images"
SIZE = (700, 300)
PALETTE = 160
"""Colours of a picture: fewer make a smaller file."""
RAISED = 0.2
"""How far the scene is moved up, in half heights of its panel, so that words and scales below it are free."""
Draw = Callable[[pv.Plotter], None]


def run(name: str) -> OutputFolder:
    """The output folder of a job, which is run where that is needed."""
    folder = JOBS / "out" / name
    damageest.run(JOBS / f"{name}.yaml", output=folder)
    return open_output(folder)


def read_skin(folder: OutputFolder, is_seen: bool) -> Mesh:
    """The part of the skin that the scan shows, without what is lost, or the part that it does not show."""
    import trimesh

    skin = trimesh.load_mesh(folder.folder / "skin.ply", process=False)
    seen, lost = (np.asarray(skin.metadata["_ply_raw"]["face"]["data"][name]).ravel() for name in ("seen", "lost"))
    return Mesh(skin.vertices, skin.faces[((seen > 0) == is_seen) & (lost < 0.5)])


def read_part(name: str) -> Mesh:
    vertices, faces, _ = read_mesh(ROOT / "jobs" / "parts" / name)
    return Mesh(vertices, faces)


def draw(name: str, left: Draw, right: Draw | None = None) -> None:
    """Two panels side by side, or one; drawn at twice the size, then made smaller, with few colours."""
    columns = 2 if right else 1
    plotter = pv.Plotter(off_screen=True, shape=(1, columns), window_size=list(SIZE), border=False)
    plotter.set_background("white")
    plotter.disable_anti_aliasing()
    plotter.ren_win.SetMultiSamples(0)
    for column, panel in enumerate(filter(None, (left, right))):
        plotter.subplot(0, column)
        plotter.enable_depth_peeling(8)
        panel(plotter)
    image = Image.fromarray(plotter.screenshot(return_img=True, scale=2)).resize(SIZE, Image.Resampling.BOX)
    path = IMAGES / f"bad-scan-{name}.png"
    image.quantize(PALETTE, dither=Image.Dither.NONE).save(path, optimize=True)
    plotter.close()
    print(f"{path.name}: {path.stat().st_size // 1000} kB")


def look(plotter: pv.Plotter, way: tuple[float, float, float], zoom: float = 1.15, title: str = "") -> None:
    plotter.view_vector(way, (0, 0, 1))
    plotter.reset_camera()
    plotter.camera.zoom(zoom)
    plotter.camera.SetWindowCenter(0, -RAISED)
    if title:
        plotter.add_text(title, position=(8, 8), font_size=8, color="black")


def add_body(plotter: pv.Plotter, mesh: Mesh | None, colour: str, opacity: float = 1.0, edges: bool = True) -> None:
    if mesh is None:
        return
    body = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces).clean()
    plotter.add_mesh(body, color=colour, opacity=opacity, ambient=0.2)
    if edges:
        lines = body.extract_feature_edges(30, boundary_edges=False, non_manifold_edges=False, manifold_edges=False)
        if lines.n_cells:
            plotter.add_mesh(lines, color="#8a959c", line_width=1.5)


def add_points(plotter: pv.Plotter, points: Floats, colour: str, size: float = 4.0) -> None:
    if len(points):
        plotter.add_mesh(pv.PolyData(points), color=colour, point_size=size)


def add_deviation(plotter: pv.Plotter, points: Floats, distance: Floats, limit: float, title: str) -> None:
    cloud = pv.PolyData(points)
    name = f"{title}, mm"
    cloud[name] = distance
    bar: dict[str, Any] = {"color": "black", "width": 0.5, "height": 0.1, "position_x": 0.25, "position_y": 0.02}
    plotter.add_mesh(
        cloud, scalars=name, cmap=colours.DEVIATION, clim=(-limit, limit), point_size=5,
        scalar_bar_args={**bar, "n_labels": 3, "title": name, "fmt": "%.2g", "title_font_size": 14},
    )  # fmt: skip


def draw_surroundings() -> None:
    """The scan with the table, and what is used of it."""
    folder = run("table")
    scan, tolerance = folder.scan, float(folder.content["tolerance"])
    assert scan is not None
    near = np.abs(scan.distance) < 3 * tolerance
    on_site = scan.site > 0

    def whole(plotter: pv.Plotter) -> None:
        add_points(plotter, scan.points[~near], colours.SURPLUS, 2.5)
        add_points(plotter, scan.points[near], colours.PART, 3)
        look(plotter, (-1, -1, 0.9), 1.3, "the scan")

    def used(plotter: pv.Plotter) -> None:
        add_points(plotter, scan.points[near & ~on_site], colours.PART, 4)
        add_points(plotter, scan.points[on_site], colours.SITES[0], 8)
        look(plotter, (-1, -1, 0.9), 1.1, "what is used of it")

    draw("surroundings", whole, used)


def draw_pose() -> None:
    """A scan of one side, in the pose found and at another place where it fits."""
    folder = run("little")
    scan = folder.scan
    assert scan is not None
    part = read_part("ribbed_plate.stl")

    def panel(title: str, change: Floats) -> Draw:
        def show(plotter: pv.Plotter) -> None:
            add_body(plotter, part, colours.PART, 0.35)
            add_points(plotter, scan.points @ change[:3, :3].T + change[:3, 3], colours.DEPOSIT, 3)
            look(plotter, (-1, -1, 1.1), 1.1, title)

        return show

    alternatives = [np.array(one) for one in folder.content["alignment"]["alternatives"] or []]
    found = np.array(folder.content["alignment"]["transform"])
    other = alternatives[0] @ np.linalg.inv(found) if alternatives else np.eye(4)
    draw("pose", panel("the pose found", np.eye(4)), panel("another one that fits", other))


def draw_noise() -> None:
    """A loss of 0.2 mm in a scan with waves: where it is, and what the scan shows."""
    folder = run("wavy")
    scan = folder.scan
    assert scan is not None
    ring = pv.Disc(center=(-8, -4, 1), inner=6.4, outer=7.0, normal=(0, 0, 1), c_res=60)

    def deviations(plotter: pv.Plotter) -> None:
        add_deviation(plotter, scan.points, scan.distance, 0.3, "deviation")
        plotter.add_mesh(ring, color="black")
        look(plotter, (0.3, -0.75, 1.2), 1.25)

    draw("noise", deviations)


def draw_unseen() -> None:
    """A hole that was scanned from one side: the damage volume, and the skin that was not seen."""
    folder = run("holes")
    scan = folder.scan
    assert scan is not None

    def points(plotter: pv.Plotter) -> None:
        add_points(plotter, scan.points[scan.site == 0], colours.PART, 3)
        add_points(plotter, scan.points[scan.site > 0], colours.SITES[0], 6)
        look(plotter, (0.9, -0.5, 1.2), 1.0, "the scan")

    def skin(plotter: pv.Plotter) -> None:
        add_body(plotter, read_skin(folder, True), "#c9d1d6", edges=False)
        add_body(plotter, read_skin(folder, False), colours.UNSEEN, edges=False)
        for site in folder.site_numbers:
            add_body(plotter, folder.read_solid("damage", site), colours.SITES[0], edges=False)
        look(plotter, (0.9, -0.5, 1.2), 1.0, "not seen (orange), the site (red)")

    draw("unseen", points, skin)


def draw_views() -> None:
    """Misplaced views, merged into one file, and each with its scanner's position."""
    merged, known = run("merged").scan, run("views").scan
    assert merged is not None
    assert known is not None

    def panel(scan: Any, title: str) -> Draw:
        every = len(scan.points) // 6000

        def show(plotter: pv.Plotter) -> None:
            add_deviation(plotter, scan.points[::every], scan.distance[::every], 0.75, title)
            look(plotter, (-0.4, -0.8, 1.2), 1.2)

        return show

    draw("views", panel(merged, "merged into one file"), panel(known, "with positions"))


def draw_stray() -> None:
    """Stray points in the air and at edges."""
    folder = run("stray")
    scan, tolerance = folder.scan, float(folder.content["tolerance"])
    assert scan is not None
    off = (np.abs(scan.distance) > tolerance) & (scan.site == 0)

    def show(plotter: pv.Plotter) -> None:
        add_points(plotter, scan.points[~off], colours.PART, 3)
        add_points(plotter, scan.points[off], colours.SURPLUS, 6)
        add_points(plotter, scan.points[scan.site > 0], colours.SITES[0], 7)
        look(plotter, (-0.6, -1, 0.7), 1.5)

    draw("stray", show)


def draw_wear() -> None:
    """Deviations of a worn cylinder at both ends of the motion that the scan leaves open."""
    folder = run("worn_face")
    scan = folder.scan
    assert scan is not None
    part = read_part("cylinder.stl")
    (motion,) = folder.content["alignment"]["free"]
    way = np.array(motion["direction"])

    def panel(by: float, title: str) -> Draw:
        points = scan.points[::2] + by * way

        def show(plotter: pv.Plotter) -> None:
            add_deviation(plotter, points, signed_distance(points, part)[0], 0.6, title)
            plotter.view_vector((0.0, -1.0, 0.0), (1, 0, 0))
            plotter.reset_camera()
            plotter.camera.zoom(1.1)
            plotter.camera.SetWindowCenter(0, -RAISED)

        return show

    draw("wear", panel(motion["low"], "one end of the motion"), panel(motion["high"], "the other end"))


def draw_surplus() -> None:
    """A weld bead beside and over a loss."""
    folder = run("bead")
    scan, tolerance = folder.scan, float(folder.content["tolerance"])
    assert scan is not None
    outside = scan.distance > tolerance

    def show(plotter: pv.Plotter) -> None:
        x, y, z = scan.points.T
        close = (np.abs(x + 8) < 18) & (np.abs(y + 4) < 12) & (z > -4.6) & (z < 4)
        add_points(plotter, scan.points[close & ~outside & (scan.site == 0)], colours.PART, 5)
        add_points(plotter, scan.points[close & outside], colours.SURPLUS, 8)
        add_points(plotter, scan.points[close & (scan.site > 0)], colours.SITES[0], 8)
        look(plotter, (-0.5, -0.8, 0.6), 1.4)

    draw("surplus", show)


PICTURES = {
    "surroundings": draw_surroundings,
    "pose": draw_pose,
    "noise": draw_noise,
    "unseen": draw_unseen,
    "views": draw_views,
    "stray": draw_stray,
    "wear": draw_wear,
    "surplus": draw_surplus,
}

if __name__ == "__main__":
    for chosen in sys.argv[1:] or PICTURES:
        try:
            PICTURES[chosen]()
        except DamageestError as error:
            print(f"{chosen}: {error}")
