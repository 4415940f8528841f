"""What is clicked stands in the job file: each tool of the page, in a real browser."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from app_page import Page, mark, open_app, serve
from app_shop import open_job, read_job, sample, write_plate
from ruamel.yaml import YAML

from tests.needs import import_or_skip
from tests.stages.report.browser import open_browser

pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]
TURN = trimesh.transformations.rotation_matrix(0.4, (0.3, -0.5, 1), (3, 2, 1))
"""A motion of a scan, known to the test alone."""


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    folder = tmp_path / "shop"
    folder.mkdir()
    return folder


def test_one_of_several_equal_poses_is_taken(shop: Path) -> None:
    block = trimesh.creation.box((40, 30, 12))
    block.export(shop / "plate.stl")
    sample(shop, block, [(20, -15, 6)])
    with open_app(shop) as page:
        open_job(page)
        page.run()
        page.wait("site")
        page.click("step-align")
        page.wait("pose", "pose 1 of 4")
        page.click("next-pose")
        page.wait("pose", "pose 2 of 4")
        page.click("next-pose")
        page.wait("pose", "pose 3 of 4")
        page.shoot("poses")
        page.click("take-pose")
        page.wait("align-use", "none")
        first = YAML(typ="safe").load((shop / "out" / "plate" / "result.json").read_text())
        align = read_job(shop)["align"]
        assert align["use"] == "none"
        assert align["T_part_scan"] == first["alignment"]["alternatives"][1]
        page.run()
        page.wait("site")
        assert page.faults == []
    second = YAML(typ="safe").load((shop / "out" / "plate" / "result.json").read_text())
    assert len(second["sites"]) == len(first["sites"]) == 1
    assert second["damage_volume"] == pytest.approx(first["damage_volume"], rel=0.05)


def test_three_pairs_find_the_pose(shop: Path) -> None:
    write_plate(shop, move=TURN)
    places = np.array([[-20, -15, 6], [20, 15, 6], [-20, -15, -6]])
    with open_app(shop) as page:
        open_job(page)
        page.click("step-align")
        page.click("tool-pairs")
        page.at_rest()
        offset = find_offset(shop)
        for k, place in enumerate(places):
            page.click_at(trimesh.transform_points([place], TURN)[0] + offset)
            page.wait("pair-next", "now the same place on the part")
            page.click_at(place)
            page.wait("pair", f"{k + 1}: scan")
        page.click_at(np.array([0, -15, 6]) * 0.99)  # no scan there: nothing is taken
        page.at_rest()
        page.shoot("pairs")
        page.click("take-pairs")
        page.wait("align-use", "points")
        page.run()
        page.wait("site")
        assert page.faults == []
    align = read_job(shop)["align"]
    assert align["use"] == "points"
    assert len(align["pairs"]) == 3
    for (scan, part), place in zip(align["pairs"], places, strict=True):
        assert np.linalg.norm(np.array(part) - place) < 1.0
        assert np.linalg.norm(scan - trimesh.transform_points([place], TURN)[0]) < 1.0
    assert len(read_result(shop)["sites"]) == 1


def test_datums_of_a_mesh_are_clicked_together_and_in_order(shop: Path) -> None:
    write_plate(shop, move=TURN)
    top, front, side = np.array([12, 8, 6]), np.array([-5, -15, -2]), np.array([20, 8, 0])
    with open_app(shop) as page:
        open_job(page)
        page.click("step-align")
        page.click("tool-datum")
        page.at_rest()
        page.click_at(top)
        page.wait("datum-row", "skin facing (0, 0, 1)")
        assert len(read_job(shop)["align"]["datum"]) == 1
        page.page.locator(mark("datum-slot"), has_text="B").click()
        page.click_at(front)
        page.wait("datum-row", "B: skin facing (0, -1, 0)")
        page.page.locator(mark("datum-slot"), has_text="C").click()
        page.click_at(side)
        page.wait("datum-row", "C: skin facing (1, 0, 0)")
        page.click_at(side)  # a second click takes it away
        page.page.locator(mark("datum-row")).nth(2).wait_for(state="detached")
        page.page.locator(mark("datum-slot"), has_text="C").click()
        page.click_at(side)
        page.wait("datum-row", "C: skin facing (1, 0, 0)")
        page.shoot("datum")
        page.run()
        page.wait("site")
        assert page.faults == []
    datum = read_job(shop)["align"]["datum"]
    assert list(datum) == ["A", "B", "C"]
    ways = [one["facing"]["direction"] for (one,) in datum.values()]
    assert np.array(ways) == pytest.approx(np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]]))
    assert [one["name"] for one in read_result(shop)["alignment"]["datums"]] == ["A", "B", "C"]


def test_datums_of_a_step_file_are_numbers_of_its_faces(shop: Path) -> None:
    cadquery = import_or_skip("cadquery")
    write_plate(shop)
    body = cadquery.Workplane("XY").box(40, 30, 12).faces(">Z").workplane().center(-9, 5).circle(5).extrude(6)
    body.val().exportStep(str(shop / "plate.step"))
    faces = cadquery.importers.importStep(str(shop / "plate.step")).val().Faces()
    with open_app(shop) as page:
        open_job(page, part="plate.step")
        page.wait("part-facts", "8 CAD faces")
        page.click("step-align")
        page.click("tool-datum")
        page.at_rest()
        for letter, place in (("A", (12, 8, 6)), ("B", (-5, -15, -2)), ("C", (20, 8, 0))):
            page.page.locator(mark("datum-slot"), has_text=letter).click()
            page.at_rest(0.5)
            page.click_at(np.array(place, float))
            page.wait("datum-row", f"{letter}: CAD face")
        page.run()
        page.wait("site")
        assert page.faults == []
    datum = read_job(shop)["align"]["datum"]
    assert list(datum) == ["A", "B", "C"]
    for (number,), axis, at in zip(datum.values(), (2, 1, 0), (6, -15, 20), strict=True):
        box = faces[number].BoundingBox()
        low, high = (getattr(box, f"{'xyz'[axis]}{end}") for end in ("min", "max"))
        assert (low, high) == pytest.approx((at, at), abs=1e-6)


def test_two_sites_become_one(shop: Path) -> None:
    write_plate(shop, damages=[(20, -15, 6), (-20, -15, 6)])
    with open_app(shop) as page:
        open_job(page)
        page.run()
        page.wait("site", "site 2")
        page.click("site")
        page.wait("section")
        page.choose("merge", "2")
        page.wait("site", "one with 1, 2")
        assert read_job(shop)["sites"]["merge"] == [[1, 2]]
        page.run()
        page.wait("site", "site 1")
        assert page.page.locator(mark("site")).count() == 1
        assert page.faults == []
    assert len(read_result(shop)["sites"]) == 1


def test_stock_and_keep_out_are_set_by_clicks(shop: Path) -> None:
    write_plate(shop)
    top, front = np.array([12, 8, 6]), np.array([-5, -15, -2])
    with open_app(shop) as page:
        open_job(page)
        page.click("step-repair")
        page.at_rest()
        page.fill("face-stock", "0.75")
        page.click_at(top)
        page.wait("target-row", "0.75 mm on skin facing (0, 0, 1)")
        page.page.get_by_text("no stock (keep out)").click()
        page.at_rest(0.5)
        page.click_at(front)
        page.wait("keep-out-row", "facing (0, -1, 0)")
        page.run()
        page.wait("site")
        assert page.faults == []
    allowance = read_job(shop)["allowance"]
    (target,), (free,) = allowance["targets"], allowance["keep_out"]
    assert target["outer"] == 0.75
    assert target["facing"]["direction"] == pytest.approx([0, 0, 1])
    assert free["facing"]["direction"] == pytest.approx([0, -1, 0])
    deposit = trimesh.load(shop / "out" / "plate" / "deposit" / "site-1.stl")
    assert deposit.bounds[1][2] == pytest.approx(6.75, abs=0.05)
    assert deposit.bounds[0][1] == pytest.approx(-15, abs=0.05)


def test_the_scan_is_cut_by_a_plane_that_is_drawn(shop: Path) -> None:
    write_plate(shop)
    points = np.loadtxt(shop / "scan.xyz")
    with open_app(shop) as page:
        open_job(page)
        page.click("step-prepare")
        page.at_rest()
        page.click("cut")
        page.wait("cut-words", "one end")
        page.click_view(0.3, 0.2)
        page.wait("cut-words", "other end")
        page.click_view(0.4, 0.9)
        page.wait("cut-words", "are removed")
        page.shoot("cut")
        page.click("cut-flip")
        page.at_rest(0.5)
        page.click("cut-flip")
        page.click("cut-take")
        page.wait("scan-facts", "cropped away")
        page.at_rest()
        assert page.faults == []
        (crop,) = read_job(shop)["scan"]["crop"]
        inside = (points - np.array(crop["point"])) @ np.array(crop["normal"]) >= 0
        assert crop["drop"] == "above"
        assert 0.02 < inside.mean() < 0.5
        assert f"({inside.sum():,} cropped away)" in page.text("scan-facts")
        page.page.keyboard.press("Control+z")
        page.wait("scan-facts", f"{len(points):,} points, ")


def test_a_file_that_is_dropped_is_copied_and_listed(shop: Path) -> None:
    write_plate(shop)
    text = (shop / "scan.xyz").read_text()
    (shop / "scan.xyz").unlink()
    code = """([name, text]) => {
        const data = new DataTransfer();
        data.items.add(new File([text], name));
        window.dispatchEvent(new DragEvent("drop", {dataTransfer: data, cancelable: true}));
    }"""
    with open_app(shop) as page:
        page.page.evaluate(code, ["../dropped.xyz", text])
        page.wait("message", "dropped.xyz is in the folder")
        assert (shop / "dropped.xyz").read_text() == text
        page.page.evaluate(code, ["program.exe", "MZ"])
        page.wait("message", "is no part and no scan")
        open_job(page, scan="dropped.xyz")
    assert sorted(path.name for path in shop.iterdir()) == ["dropped.xyz", "out", "plate.stl", "plate.yaml"]


def test_two_tabs_and_two_apps_on_one_folder(shop: Path) -> None:
    write_plate(shop)
    with serve(shop) as (_, here), serve(shop) as (_, there), open_browser() as browser:
        first = Page(browser, here)
        open_job(first)
        tab, other = Page(browser, here), Page(browser, there)
        tab.wait("job-name", "plate.yaml")  # a second tab shows what the first one does
        other.choose("job", "plate.yaml")
        other.wait("part-facts", "mm")
        first.click("step-prepare")
        first.click("crop-piece")
        first.wait("scan-facts", "points")
        first.at_rest()
        assert "largest piece" in tab.page.locator(mark("job-text")).text_content()
        written = (shop / "plate.yaml").read_text()
        other.click("step-repair")
        other.fill("outer", "0.4")
        other.wait("message", "was changed by another program")
        assert (shop / "plate.yaml").read_text() == written
        other.click("reload")
        other.at_rest()
        other.fill("outer", "0.5")
        other.at_rest()
    assert read_job(shop)["allowance"]["outer"] == 0.5
    assert read_job(shop)["scan"]["crop"] == [{"keep": "largest piece"}]


def test_doubtful_jobs_are_filtered_and_opened_one_after_the_other(shop: Path) -> None:
    write_plate(shop)
    for name in ("a", "b"):
        (shop / f"{name}.yaml").write_text("version: 1\npart: plate.stl\nscan: scan.xyz\ntolerance: 0.1\nalign: none\n")
    (shop / "c.yaml").write_text("version: 1\npart: plate.stl\nscan: scan.xyz\n")
    (shop / "out" / "c").mkdir(parents=True)
    (shop / "out" / "c" / "result.json").write_text('{"sites": []}')
    with open_app(shop) as page:
        page.click("step-several")
        page.wait("job-row", "a.yaml")
        page.wait("job-row", "result cannot be read")
        page.click("run-all")  # c is not run: it has a result
        page.wait("stop")
        page.page.locator(mark("job-row"), has_text="proven 1").nth(1).wait_for(timeout=120_000)
        result = shop / "out" / "b" / "result.json"
        content = json.loads(result.read_text())
        content["sites"][0]["verdict"]["level"] = "doubtful"
        result.write_text(json.dumps(content))
        page.click("look")
        page.wait("job-row", "doubtful 1")
        page.page.locator(f"{mark('only-doubtful')} input").click()
        page.page.locator(mark("job-row")).nth(1).wait_for(state="detached")
        page.click("next-job")
        page.wait("job-name", "b.yaml")
        page.page.locator(f"{mark('only-doubtful')} input").click()
        page.click("next-job")
        page.wait("job-name", "c.yaml")
        page.wait("message", "run the job again")
        assert page.faults == []


def find_offset(shop: Path) -> Any:
    """By how much the page moves a scan to show it beside the part."""
    from damageest_app.panels.shown import place_beside

    part = trimesh.load(shop / "plate.stl")
    return place_beside(np.array(part.bounds), np.loadtxt(shop / "scan.xyz"))


def read_result(shop: Path) -> Any:
    return YAML(typ="safe").load((shop / "out" / "plate" / "result.json").read_text())
