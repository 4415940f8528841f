"""What the page computes for the eye, on shapes with known truth; and the process of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from damageest_app import edits
from damageest_app.folder import Folder, guess_inputs
from damageest_app.running.runner import Progress, Runner, describe_end
from damageest_app.view.faces import Faces
from damageest_app.view.histogram import Histogram
from damageest_app.view.pathview import PathPlay, make_nozzle
from damageest_app.view.pick import MeshPicker, Ray, find_point
from damageest_app.view.section import Cutter, choose_plane, draw, measure_depth
from ruamel.yaml import YAML

from damageest.artefacts import Mesh, Part
from damageest.geometry.make_part import make_part
from damageest.registry import Registry
from tests.needs import import_or_skip


@pytest.fixture(scope="module")
def box() -> Part:
    body = trimesh.creation.box((40, 30, 20))
    return make_part(np.asarray(body.vertices), np.asarray(body.faces), unit="mm")


def look(x: float, y: float) -> Ray:
    """A click of a camera 100 above the box, whose up is y; the view is 90 degrees high."""
    camera = {"position": [0, 0, 100], "focalPoint": [0, 0, 0], "viewUp": [0, 1, 0], "viewAngle": 90.0}
    return Ray.of_click({"x": x, "y": y, "aspect": 2.0, "camera": camera})


def test_a_click_meets_the_place_that_is_seen_there(box: Part) -> None:
    hit = MeshPicker(box).find(look(0.05, 0.1))
    assert hit is not None
    assert hit[0] == pytest.approx([9, 9, 10], abs=1e-4)  # 90 before the top: 0.05 · 2 · 90, 0.1 · 90
    assert box.face_normals[hit[1]] == pytest.approx([0, 0, 1])
    assert MeshPicker(box).find(look(0.9, 0.9)) is None


def test_a_click_a_few_pixels_beside_an_edge_meets_it(box: Part) -> None:
    hit = MeshPicker(box).find(look(0.0, 15.5 / 90))  # the edge is at 15, 90 before the camera
    assert hit is not None
    assert hit[0] == pytest.approx([0, 15, 10], abs=0.6)
    assert MeshPicker(box).find(look(0.0, 17 / 90)) is None


def test_the_scan_point_in_front_is_picked() -> None:
    points = np.array([[9.0, 9.1, 10], [9.2, 9, 10], [9.9, 9.9, 1], [0, 0, 10]])
    assert find_point(points, look(0.05, 0.1)) == 0
    assert find_point(points, look(-0.5, 0.1)) is None


def test_a_face_of_a_mesh_is_named_so_that_the_core_selects_it_alone(box: Part) -> None:
    faces = Faces(box)
    for triangle in range(len(box.faces)):
        named = faces.select(triangle)
        same = np.abs(box.face_normals @ box.face_normals[triangle] - 1) < 1e-9
        assert (faces.match(named) == same).all()
        tree = YAML().load("version: 1\nalign: register # a comment\n")
        edits.toggle_datum(tree, named)
        assert (faces.match(edits.plain(tree["align"]["datum"][0])) == same).all()  # also with fewer digits
        edits.toggle_datum(tree, named)
        assert "datum" not in tree["align"]


def test_a_section_has_the_area_of_the_body_and_measures_in_its_unit() -> None:
    ball = trimesh.creation.icosphere(4, 5.0)
    body = Mesh(np.asarray(ball.vertices) + np.array([3, 4, 5]), np.asarray(ball.faces))
    plane = choose_plane(body, None, "x")
    assert measure_depth(body, plane) == pytest.approx(5, rel=0.01)
    for offset in (0.0, 3.0):
        (loop,) = Cutter(body).cut(plane.shift(offset))
        x, y = loop.T
        area = abs(np.dot(x[:-1], y[1:]) - np.dot(x[1:], y[:-1])) / 2
        assert area == pytest.approx(np.pi * (25 - offset**2), rel=0.02)
    loops = {"damage": Cutter(body).cut(plane)}
    drawing = draw(plane, loops, np.empty((0, 3)), 1.0, "mm", "#d1495b")
    first, second = drawing.to_plane(0, 0), drawing.to_plane(drawing.scale * 7, 0)
    assert second[0] - first[0] == pytest.approx(7)
    assert "7 mm" in draw(plane, loops, np.empty((0, 3)), 1.0, "mm", "#d1495b", [first, second]).svg


def test_the_histogram_counts_what_is_nearer_than_the_tolerance() -> None:
    distance = np.concatenate([np.linspace(-0.1, 0.1, 90), np.full(10, -2.0), [np.nan]])
    shown = Histogram(distance, 0.02, 0.2)
    assert shown.share(0.2) == pytest.approx(0.9)
    assert shown.share(3.0) == 1.0


def test_a_path_is_laid_in_the_time_that_its_feeds_take(tmp_path: Path) -> None:
    head = "x,y,z,i,j,k,feed,on,layer,pass,kind\n"
    rows = [
        "0,0,5,0,0,1,100,0,1,1,row",
        "10,0,5,0,0,1,10,1,1,1,row",
        "10,0,7,0,0,1,100,0,2,2,row",
        "0,0,7,0,0,1,10,1,2,2,row",
    ]
    (tmp_path / "path.csv").write_text(head + "\n".join(rows) + "\n")
    play = PathPlay.read(tmp_path / "path.csv")
    assert play.minutes == pytest.approx([0, 1, 1.02, 2.02])
    waits = [head.strip() + ",dwell", *(f"{row},{wait}" for row, wait in zip(rows, (0, 0, 30, 0), strict=True))]
    (tmp_path / "waits.csv").write_text("\n".join(waits) + "\n")
    assert PathPlay.read(tmp_path / "waits.csv").minutes == pytest.approx([0, 1, 1.02, 2.52])
    assert play.at(0.5) == 1
    assert play.share_of_layer(1) == pytest.approx(1 / 2.02)
    pieces, layers = play.list_passes(3)
    assert layers == [1, 2]
    assert pieces[0] == pytest.approx(np.array([[0, 0, 5.0], [10, 0, 5]]))
    nozzle = make_nozzle(
        {"tip_radius": 1, "cone_angle": 45, "length": 20, "body_radius": 5}, play.points[1], play.axes[1]
    )
    assert nozzle is not None
    assert nozzle.bounds == pytest.approx(np.array([[5, -5, 5.0], [15, 5, 25]]))


@pytest.mark.slow
def test_units_that_explain_the_sizes_are_offered(tmp_path: Path, registry: Registry) -> None:
    body = trimesh.creation.box((40, 30, 20))
    body.export(tmp_path / "box.stl")
    np.savetxt(tmp_path / "scan.xyz", body.sample(3000, seed=1) / 25.4)
    values = {"version": 1, "units": "mm", "part": "box.stl", "scan": "scan.xyz"}
    inputs = import_or_skip("damageest_app.inputs")
    found = inputs.Reader(registry).read(values, tmp_path)
    assert found.doubt
    assert found.offers[0] == ("scan", "in")
    right = inputs.Reader(registry).read({**values, "scan": {"path": "scan.xyz", "unit": "in"}}, tmp_path)
    assert (right.doubt, right.offers) == ("", ())


def test_a_unit_that_is_put_right_drops_the_tolerance_that_was_measured_in_the_other() -> None:
    tree = YAML().load("tolerance: 0.01 # measured\nscan: scan.xyz\n")
    edits.set_unit(tree, "scan", "in")
    assert edits.plain(tree) == {"tolerance": "auto", "scan": {"path": "scan.xyz", "unit": "in"}}


@pytest.mark.slow
def test_a_command_that_fails_says_why_and_one_that_ends_leaves_no_process(tmp_path: Path) -> None:
    runner = Runner()
    outcome = runner.call(["run", "missing.yaml", "--quiet"], tmp_path)
    assert outcome.status == 2
    assert "missing.yaml" in describe_end(outcome, "align")
    assert not runner.is_busy


def test_progress_grows_and_names_what_is_done() -> None:
    progress, shares = Progress(), []
    for stage in ("part", "scan", "align", "enclose", "report"):
        progress.take({"kind": "begin", "stage": stage, "use": "x", "site": 0})
        shares.append(progress.share)
        progress.take({"kind": "end", "stage": stage, "seconds": 0.1, "site": 0})
    assert shares == sorted(shares)
    assert [one["name"] for one in progress.stages] == ["part", "scan", "align", "enclose", "report"]


@pytest.mark.parametrize(
    ("names", "found"),
    [
        (["part.step", "scan.ply"], ("part.step", "scan.ply")),
        (["part.stl", "scan.ply"], ("part.stl", "scan.ply")),
        (["part.step", "part.stl", "scan.xyz"], ("part.step", "scan.xyz")),
        (["part.step", "scan.stl"], ("part.step", "scan.stl")),
        (["a.stl", "b.stl", "scan.ply"], (None, None)),
        (["part.stl", "a.ply", "b.ply"], ("part.stl", None)),
        (["scan.xyz"], (None, None)),
        ([], (None, None)),
    ],
)
def test_part_and_scan_are_chosen_where_there_is_no_choice(
    tmp_path: Path, registry: Registry, names: list[str], found: tuple[str | None, str | None]
) -> None:
    for name in names:
        (tmp_path / name).write_text("")
    assert guess_inputs(Folder.open(tmp_path, registry).list_files()) == found


def test_what_a_path_leaves_out_is_told_in_red_from_a_twentieth() -> None:
    from types import SimpleNamespace

    from damageest_app.running.results import Results

    def path(volume: float, why: str) -> dict[str, object]:
        return {
            "deposit_volume": 2200.0, "unreachable_volume": volume, "surplus_volume": 1144.0,
            "unreached": [{"volume": volume, "why": why}], "fill": None,
        }  # fmt: skip

    note = [{"code": "path", "text": "the nozzle is near the flange"}, {"code": "enclose", "text": "other"}]
    sites = [
        {"id": 1, "path": path(332.0, "not reached"), "warnings": note},
        {"id": 2, "path": path(22.0, "narrower than a bead"), "warnings": []},
        {"id": 3, "path": None, "warnings": []},
    ]
    told = Results.list_path_faults(SimpleNamespace(content={"sites": sites}, unit="mm"))  # type: ignore[arg-type]
    assert [one["is_much"] for one in told] == [True, False, False]
    assert told[0]["text"].startswith("site 1: 15.1% of the deposit is not filled; 332 mm³ not reached; ")
    assert "the passes add 52% beyond" in told[0]["text"]
    assert told[1]["text"] == "site 1: the nozzle is near the flange"


def test_the_link_to_the_zip_downloads_and_does_not_leave_the_app() -> None:
    """A link without the attribute `download` takes the page, and with it the connection, away."""
    import inspect

    from damageest_app.panels import repair
    from damageest_app.panels.marks import mark
    from trame.app import get_server
    from trame.ui.vuetify3 import VAppLayout
    from trame.widgets import vuetify3 as v3

    assert "download=True" not in inspect.getsource(repair), "trame drops what it does not know"
    with VAppLayout(get_server("zip", client_type="vue3")) as layout:
        v3.VBtn("zip", href="/download", raw_attrs=mark("download", "download"))
    assert " download" in layout.html.replace('data-test="download"', "").replace('"/download"', "")
