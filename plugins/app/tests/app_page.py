"""The app in a process of its own, and its page in a Chromium without a window."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from tests.stages.report.browser import open_browser

ROOT = Path(__file__).parents[3]
COMMAND = [sys.executable, "-c", "from damageest.cli import main; main()"]
NORMAL = ("/paraview/", "405 (Method Not Allowed)", "without a current renderer")
"""The client of trame asks for a launcher first, which there is not; the mouse may move before anything is drawn."""


@contextmanager
def serve(folder: Path, *words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Starts `damageest app` and gives its process and address."""
    env = {**os.environ, "PYTHONUNBUFFERED": "1"}
    command = [*COMMAND, "app", str(folder), "--no-browser", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env)
    try:
        assert process.stdout
        while not (found := re.search(r"http://\S+", line := process.stdout.readline())):
            assert line, process.communicate()[1]
        yield process, found.group(0)
    finally:
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


@contextmanager
def open_app(folder: Path) -> Iterator[Page]:
    """The page of an app on a folder; at its end the app still answers. A test that fails leaves a picture beside the
    folder."""
    with serve(folder) as (process, address), open_browser() as browser:
        page = Page(browser, address)
        try:
            yield page
        except BaseException:
            page.page.screenshot(path=str(folder.parent / "failed.png"))
            raise
        assert process.poll() is None, "the app has ended"


class Page:
    """The page of the app. ``faults``: errors of its console, and requests that failed or left the machine."""

    def __init__(self, browser: Any, address: str, width: int = 1280, height: int = 800) -> None:
        self.page = browser.new_page(viewport={"width": width, "height": height})
        self.faults: list[str] = []
        self.page.on("console", lambda m: self.note(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.note(str(error)))
        self.page.on("request", lambda r: self._check(r.url))
        self.page.on("response", lambda r: self.note(f"{r.status} {r.url}") if r.status >= 400 else None)
        self.page.goto(address)
        self.page.wait_for_selector(mark("step-open"), timeout=60_000)

    def note(self, fault: str) -> None:
        if not any(word in fault for word in NORMAL):
            self.faults.append(fault)

    def _check(self, url: str) -> None:
        if not re.match(r"(http|ws)://127\.0\.0\.1[:/]|data:|blob:", url):
            self.faults.append(f"leaves the machine: {url}")

    def click(self, name: str, nth: int = 0) -> None:
        self.page.locator(mark(name)).nth(nth).click()

    def choose(self, name: str, text: str) -> None:
        """Picks an entry of a list."""
        self.click(name)
        self.page.locator(".v-overlay--active .v-list-item", has_text=text).first.click()
        self.page.keyboard.press("Escape")
        self.page.wait_for_timeout(300)

    def wait(self, name: str, text: str = "", seconds: float = 30) -> None:
        where = self.page.locator(mark(name), has_text=text) if text else self.page.locator(mark(name))
        where.first.wait_for(timeout=seconds * 1000)

    def text(self, name: str) -> str:
        return str(self.page.locator(mark(name)).first.inner_text())

    def fill(self, name: str, value: str) -> None:
        field = self.page.locator(f"{mark(name)} input").first
        field.fill(value)
        field.press("Tab")

    def at_rest(self, seconds: float = 1.2) -> None:
        """Waits until what was asked for is read and drawn."""
        self.page.wait_for_timeout(seconds * 1000)
        self.page.locator(mark("busy")).wait_for(state="detached")

    def click_view(self, x: float, y: float) -> None:
        """A click into the 3D view, from 0 to 1."""
        box = self.page.locator(".stage .view").bounding_box()
        self.page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])

    def click_at(self, place: Any) -> None:
        """A click on a place (3,) of the 3D view."""
        camera = self.page.evaluate("window.trame.refs.view.getCamera()")
        box = self.page.locator(".stage .view").bounding_box()
        eye, focal, up = (np.array(camera[name], float) for name in ("position", "focalPoint", "viewUp"))
        ahead = (focal - eye) / np.linalg.norm(focal - eye)
        right = np.cross(ahead, up) / np.linalg.norm(np.cross(ahead, up))
        way = np.asarray(place, float) - eye
        reach = (way @ ahead) * np.tan(np.radians(camera["viewAngle"]) / 2)
        x, y = way @ right / reach * box["height"] / box["width"], way @ np.cross(right, ahead) / reach
        self.click_view((1 + x) / 2, (1 - y) / 2)

    def run(self, seconds: float = 300) -> None:
        """Runs the job and waits for its end."""
        self.click("run")
        self.wait("stop")
        end = time.monotonic() + seconds
        while self.page.locator(mark("stop")).count():
            assert time.monotonic() < end, "the run does not end"
            self.page.wait_for_timeout(200)
        self.at_rest()

    def shoot(self, name: str) -> None:
        """A picture for the documentation; where no pictures are wanted, none."""
        self.at_rest()
        if os.environ.get("DAMAGEEST_PICTURES"):
            self.shot(ROOT / "docs" / "images" / "app" / f"{name}.png")

    def shot(self, path: Path) -> None:
        """A picture with few colours, so that it is small."""
        from PIL import Image

        self.page.screenshot(path=str(path))
        with Image.open(path) as image:
            image.convert("RGB").quantize(255, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
                path, optimize=True
            )


def mark(name: str) -> str:
    return f'[data-test="{name}"]'
