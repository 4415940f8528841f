"""From a part and a scan to the files for the machine, in a real browser, and the same from the terminal. Slow.

With DAMAGEEST_PICTURES=FOLDER the pictures of docs/app.md are written there.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request
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
