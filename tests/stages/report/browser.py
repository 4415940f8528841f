"""A Chromium of the system, without a window, for the tests of pages."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OPTIONS = [
    "--no-sandbox",  # as root, as in a container
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]

BROKEN = """[...document.querySelectorAll('td, th')].filter(one => one.checkVisibility()).flatMap(cell => {
  const found = [], walk = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) for (const word of walk.currentNode.data.matchAll(/[\\p{L}\\d.]+/gu)) {
    const range = document.createRange();
    range.setStart(walk.currentNode, word.index);
    range.setEnd(walk.currentNode, word.index + word[0].length);
    if (new Set([...range.getClientRects()].map(box => Math.round(box.top))).size > 1) found.push(word[0]);
  }
  return found;
})"""
"""The words of tables that go on in the next line, since their column is narrower than they are."""
WIDTHS = (390, 1024, 1400, 2560)
"""Widths of a window: of a phone, and of three screens."""


def find_browser() -> str:
    """The path of a Chromium. Skips the test where there is none, or no playwright to drive it."""
    pytest.importorskip("playwright", reason="playwright is not installed: pip install playwright")
    found = next((path for name in NAMES if (path := shutil.which(name))), "")
    if not found:
        pytest.skip("there is no Chromium here: apt-get install chromium")
    return found


@contextmanager
def open_browser() -> Iterator[Any]:
    path = find_browser()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=OPTIONS)
        yield browser
        browser.close()


class Shown:
    """A report that a browser shows. ``faults``: errors and warnings of its console, requests for other files."""

    def __init__(self, browser: Any, path: Path, hash: str = "", **options: Any) -> None:
        options = {"viewport": {"width": 720, "height": 560}, "reduced_motion": "reduce", **options}
        self.page = browser.new_page(**options)
        self.faults: list[str] = []
        self.page.on("console", lambda m: self.faults.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on(
            "request",
            lambda r: self.faults.append(r.url) if not r.url.startswith(("file:", "data:", "blob:")) else None,
        )
        self.page.goto(path.as_uri() + hash)
        self.page.wait_for_selector("body[data-ready=yes]", timeout=60_000)
        self.settle()

    def settle(self) -> None:
        """Waits until what was asked for is drawn."""
        self.page.evaluate("new Promise(done => { const f = (n) => n ? requestAnimationFrame(() => f(n - 1)) : done();"
                           " report.view3d.render(true); setTimeout(() => f(3), 120); })")  # fmt: skip

    def picture(self) -> np.ndarray:
        """The 3D view as pixels (H,W,3)."""
        from PIL import Image

        data = self.page.locator("#canvas").screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)

    def switch(self, layer: str, on: bool) -> None:
        self.page.set_checked(f"input[data-layer={layer}]", on)
        self.settle()

    def camera(self) -> np.ndarray:
        """Where the camera is, and what it looks at (6,)."""
        code = "(({camera, controls}) => [...camera.position, ...controls.target])(report.view3d.getWorld())"
        return np.array(self.page.evaluate(code))
