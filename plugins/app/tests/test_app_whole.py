"""A person without YAML goes from a part and a scan to files for the machine, in a real browser."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import pytest
from app_page import COMMAND, Page, serve
from ruamel.yaml import YAML

from tests.stages.report.browser import find_browser, open_browser

ROOT = Path(__file__).parents[3]
JOBS = ROOT / "jobs"


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Where the pictures of the documentation go: into it where DAMAGEEST_PICTURES is set, else nowhere that lasts."""
    folder = ROOT / "docs" / "images" / "app" if os.environ.get("DAMAGEEST_PICTURES") else tmp_path / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def read_output(folder: Path) -> dict[str, bytes]:
    """The files of an output folder, with what depends on the clock and the place of the folder left out."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and not name.startswith("stages/"):
            found[name] = path.read_bytes()
    content = json.loads(found.pop("result.json"))
    for key in ("stages", "steps"):
        content[key] = [{k: v for k, v in one.items() if k not in ("seconds", "cached")} for one in content[key]]
    content["provenance"].pop("sha256")  # of the page as well
    outputs = content["provenance"]["outputs"]
    content["provenance"]["outputs"] = [one for one in outputs if one["path"] != "report.html"]
    found["result.json"] = json.dumps(content).encode()
    found.pop("report.html", None)  # it shows the seconds of the stages
    return found


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_from_open_to_export(tmp_path: Path, pictures: Path) -> None:
    find_browser()
    folder = tmp_path / "shop"
    folder.mkdir()
    for name in ("parts/block.stl", "scans/block_wedge.ply"):
        shutil.copy(JOBS / name, folder)
    with serve(folder) as (process, address), open_browser() as browser:
        page = Page(browser, address)
        _open(page, pictures)
        _prepare(page, pictures)
        _align(page, pictures)
        _judge(page, pictures)
        _repair(page, pictures)
        _several(page, pictures)
        with page.page.expect_download() as waiting:
            page.click("step-repair")
            page.click("repair-export")
            page.click("download")
        page.click("step-judge")
        page.wait("site", "proven")  # the app goes on
        with zipfile.ZipFile(waiting.value.path()) as archive:
            names = archive.namelist()
        assert {"block/result.json", "block/damage.stl", "block/path/site-1.ngc", "block/report.html"} <= set(names)
        assert not [name for name in names if "stages" in name]
        assert page.faults == []
        assert process.poll() is None
    job = YAML(typ="safe").load((folder / "block.yaml").read_text())
    check_job(job)
    assert "# lambda: points closer to the nominal surface are intact" in (folder / "block.yaml").read_text()
    other = folder / "out" / "again"
    words = [*COMMAND, "run", "block.yaml", "-o", str(other), "--no-cache", "--quiet"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert read_output(folder / "out" / "block") == read_output(other)


def check_job(job: dict[str, Any]) -> None:
    """Everything that was clicked stands in the job."""
    assert job["scan"] == {"path": "block_wedge.ply", "crop": [{"keep": "largest piece"}]}
    assert job["align"]["use"] == "register"
    assert len(job["align"]["datum"]) == 1
    assert job["allowance"]["outer"] == 0.3
    assert [target["outer"] for target in job["allowance"]["targets"]] == [0.8]
    assert job["path"]["width"] == 3.0
    assert job["path"]["nozzle"]["body_radius"] == 9.0
    assert job["export"]["format"] == ["stl", "3mf"]
    assert "sites" not in job  # the drop was undone


def _open(page: Page, pictures: Path) -> None:
    page.choose("part", "block.stl")
    page.choose("scan", "block_wedge.ply")
    page.click("make")
    page.wait("part-facts", "80 × 60 × 30 mm", 60)
    page.at_rest(2)
    page.shot(pictures / "open.png")


def _prepare(page: Page, pictures: Path) -> None:
    page.click("step-prepare")
    page.click("crop-piece")
    page.wait("scan-facts", "cropped away")
    page.click("undo")
    page.wait("scan-facts", "110,000 points, ")
    page.click("redo")
    page.wait("scan-facts", "cropped away")
    page.click("run")
    page.wait("stop")
    page.wait("doing", "align", 60)
    page.shot(pictures / "run.png")
    page.wait("site", seconds=200)
    page.at_rest()
    page.click("step-prepare")
    page.wait("share", "of the points are nearer")
    page.at_rest()
    page.shot(pictures / "prepare.png")


def _align(page: Page, pictures: Path) -> None:
    page.click("step-align")
    page.wait("legend")
    page.at_rest(2)
    page.shot(pictures / "align.png")
    page.click("tool-pairs")
    page.at_rest()
    page.click_view(0.72, 0.5)
    page.wait("pair-next", "now the same place on the part")
    page.click_view(0.25, 0.5)
    page.wait("pair-next", "a place on the scan")
    page.at_rest()
    page.click("tool-datum")
    page.at_rest()
    page.click_view(0.45, 0.62)
    page.wait("datum-row", "skin facing")
    page.at_rest()


def _judge(page: Page, pictures: Path) -> None:
    page.click("step-judge")
    page.wait("site", "proven")
    page.click("site")
    page.wait("section")
    page.at_rest()
    box = page.page.locator('[data-test="section"]').bounding_box()
    for share in (0.4, 0.6):
        page.page.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
        page.at_rest(0.5)
    assert "mm" in page.page.locator('[data-test="section"] .length').text_content()
    page.shot(pictures / "judge.png")
    page.click("drop")
    page.wait("site", "dropped")
    page.page.keyboard.press("Control+z")
    page.wait("site", "proven")
    page.at_rest(0.5)
    assert "dropped" not in page.text("site")


def _repair(page: Page, pictures: Path) -> None:
    page.click("step-repair")
    page.at_rest()
    page.fill("outer", "0.3")
    page.at_rest(0.5)
    page.fill("face-stock", "0.8")
    page.click_view(0.45, 0.62)
    page.wait("target-row", "0.8 mm on skin")
    page.at_rest()
    page.shot(pictures / "stock.png")
    page.click("repair-path")
    page.click("add-path")
    page.wait("path-width")
    for name, value in (("width", "3"), ("height", "1.5"), ("standoff", "6"), ("body_radius", "9"), ("length", "60")):
        page.fill(f"path-{name}", value)
        page.at_rest(0.4)
    page.click("repair-export")
    page.choose("formats", "3mf")
    page.at_rest()
    page.run()
    page.click("step-repair")
    page.click("repair-path")
    page.wait("path-words", "layer")
    page.at_rest()
    page.page.locator('[data-test="time"] [role=slider]').focus()
    for _ in range(8):
        page.page.keyboard.press("PageDown")
    page.at_rest()
    page.shot(pictures / "path.png")
    page.click("repair-export")
    page.at_rest()
    page.shot(pictures / "export.png")


def _several(page: Page, pictures: Path) -> None:
    page.click("step-several")
    page.wait("job-row", "proven 1")
    page.click("dark")
    page.at_rest(1.5)
    page.shot(pictures / "several.png")
    page.click("dark")
