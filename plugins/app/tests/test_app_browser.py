"""From a part and a scan to the files for the machine, in a real browser, and the same from the terminal. Slow.

With DAMAGEEST_PICTURES=FOLDER the pictures of docs/app.md are written there.
"""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from damageest.job.yamlfile import parse
from tests.stages.report.browser import find_browser, open_browser

JOBS = Path(__file__).parents[3] / "jobs"
PICTURES = os.environ.get("DAMAGEEST_PICTURES")

pytestmark = pytest.mark.slow


class App:
    """The app on a folder, and a page that shows it."""

    def __init__(self, folder: Path, page: Any, address: str) -> None:
        self.folder, self.page, self.address = folder, page, address
        self.faults: list[str] = []
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.on("console", lambda m: self.faults.append(m.text) if m.type == "error" and "405" not in m.text else None)
        self.others: list[str] = []
        page.on("request", lambda r: None if _is_own(r.url, address) else self.others.append(r.url))
        page.goto(address)

    def find(self, mark: str) -> Any:
        return self.page.locator(f"[data-test={mark}]")

    def choose(self, mark: str, value: str) -> None:
        self.find(mark).click()
        self.page.locator(".v-overlay .v-list-item", has_text=value).first.click()

    def shoot(self, name: str) -> None:
        if PICTURES:
            self.page.wait_for_timeout(1500)
            self.page.screenshot(path=str(Path(PICTURES) / f"app-{name}.png"))

    def values(self) -> dict[str, Any]:
        (job,) = self.folder.glob("*.yaml")
        return dict(parse(job.read_text(), str(job))[0])

    def run(self) -> None:
        self.find("run").click()
        self.find("stop").wait_for(timeout=10_000)
        self.find("run").wait_for(timeout=180_000)


def _is_own(url: str, address: str) -> bool:
    return url.startswith(
        (address.split("/index")[0], address.split("/index")[0].replace("http", "ws"), "data:", "blob:")
    )


@pytest.fixture
def app(tmp_path: Path) -> Iterator[App]:
    find_browser()
    folder = tmp_path / "folder"
    folder.mkdir()
    shutil.copy(JOBS / "parts/block.stl", folder)
    shutil.copy(JOBS / "scans/block_wedge.ply", folder)
    command = [sys.executable, "-c", "from damageest.cli import main; main()", "app", str(folder), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            address = next(found[0] for line in process.stdout if (found := re.search(r"http://\S+", line)))
            with open_browser() as browser:
                yield App(folder, browser.new_page(viewport={"width": 1280, "height": 800}), address)
        finally:
            process.terminate()


def test_from_open_to_export_and_the_same_in_the_terminal(app: App, tmp_path: Path) -> None:
    app.find("part").wait_for(timeout=60_000)
    app.choose("part", "block.stl")
    app.choose("scan", "block_wedge.ply")
    app.find("make").click()
    app.find("part-facts").wait_for(timeout=60_000)
    assert "80 × 60 × 30 mm" in app.find("part-facts").inner_text()
    assert "110,000 points" in app.find("scan-facts").inner_text()
    app.shoot("open")

    app.find("step-prepare").click()
    app.find("crop-piece").click()
    app.page.get_by_text("1. keep largest piece").wait_for(timeout=60_000)
    assert app.values()["scan"]["crop"] == [{"keep": "largest piece"}]
    app.find("undo").click()
    app.page.get_by_text("1. keep largest piece").wait_for(state="detached", timeout=60_000)
    assert app.values()["scan"] == "block_wedge.ply"

    app.run()
    app.find("site").wait_for(timeout=60_000)
    app.find("site").click()
    app.find("section").wait_for(timeout=20_000)
    assert "proven" in app.find("site").inner_text()
    app.shoot("judge")
    app.find("drop").click()
    app.page.get_by_text("dropped").wait_for(timeout=20_000)
    assert app.values()["sites"] == {"drop": [1]}
    app.page.keyboard.press("Control+z")
    app.page.get_by_text("dropped").wait_for(state="detached", timeout=60_000)
    assert "sites" not in app.values()

    app.find("step-prepare").click()
    app.find("share").wait_for(timeout=20_000)
    app.shoot("prepare")
    app.find("step-align").click()
    app.page.locator(".legend .row").first.wait_for(timeout=20_000)
    app.shoot("align")

    app.find("step-repair").click()
    app.find("outer").locator("input").fill("0.5")
    app.find("outer").locator("input").press("Tab")
    app.page.get_by_text("no allowance").wait_for(timeout=20_000)
    assert app.values()["allowance"] == {"use": "milling", "outer": 0.5}
    app.run()
    app.find("step-repair").click()
    app.shoot("repair")
    app.find("repair-export").click()
    app.find("download").wait_for(timeout=20_000)

    with urllib.request.urlopen(app.address.replace("/index.html", "/download")) as answer:
        archive = zipfile.ZipFile(io.BytesIO(answer.read()))
    (out,) = (app.folder / "out").iterdir()
    names = {name.partition("/")[2] for name in archive.namelist()}
    assert {"result.json", "damage/site-1.stl", "deposit/site-1.stl"} <= names
    assert app.faults == []
    assert app.others == []

    (job,) = app.folder.glob("*.yaml")
    again = tmp_path / "again"
    words = ["run", str(job), "--output", str(again), "--no-cache", "--quiet"]
    subprocess.run([sys.executable, "-c", "from damageest.cli import main; main()", *words], check=True)
    for name in ("damage/site-1.stl", "deposit/site-1.stl", "undamaged.stl", "scan.ply", "surface/site-1.ply"):
        assert (again / name).read_bytes() == (out / name).read_bytes(), name
    first, second = (json.loads((place / "result.json").read_text())["sites"] for place in (out, again))
    assert first == second


def test_without_the_token_nothing_is_answered(app: App) -> None:
    place = app.address.split("/index")[0]
    for path in ("/index.html", "/download", "/index.html?token=guess"):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(place + path)
    other = urllib.request.Request(app.address, headers={"Origin": "http://attacker.example"})
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(other)


def test_a_broken_scan_is_said_and_the_app_goes_on(app: App) -> None:
    (app.folder / "broken.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 5\n")
    app.page.reload()
    app.find("part").wait_for(timeout=60_000)
    app.choose("part", "block.stl")
    app.choose("scan", "broken.ply")
    app.find("make").click()
    app.find("message").wait_for(timeout=60_000)
    assert "broken.ply" in app.find("message").inner_text()
    app.shoot("broken")
    app.choose("scan", "block_wedge.ply")
    app.find("make").click()
    app.find("part-facts").wait_for(timeout=60_000)
