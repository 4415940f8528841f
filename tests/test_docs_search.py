"""The built pages open from disk; their search answers questions in at most two clicks, without server or network."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.stages.report import browser

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow  # the site is built, without its notebooks: half a minute
SHOWN = 3
"""Pages of the list of results within which the answer has to be."""
QUESTIONS = {
    "my scan is in inches": ("bad-scan.html#the-unit-is-wrong", "unit of the CAD model"),
    "which side is lost": ("stages.html#which-side-is-lost", "side: auto"),
    "how do I add stock on one face": ("cam.html#stock-on-one-face", "targets"),
    "what is proven": ("verdicts.html#what-proven-likely-and-doubtful-mean", "at most 5 %"),
    "my plugin is not found": ("plugin-guide.html#a-plugin-is-not-found", "damageest plugins"),
    "KUKA": ("scan-to-program.html#kuka", "$BASE"),
    "no OpenGL": ("install.html#trouble", "libegl1"),
    "two scans of one part": ("scan-difference.html", "earlier scan stands for the part"),
    "the part is bent": ("adaptive.html", "adapt: auto"),
    "how exact is it": ("accuracy.html", "IoU 0.993"),
    # of a repair engineer, of who brings a deposit to a machine, of an author of a plugin
    "how deep is the wear": ("sections.html#how-deep-the-wear-is", "deepest"),
    "only one side was scanned": (
        "bad-scan.html#the-scan-has-holes-and-shadows",
        "Skin without points is never damage",
    ),
    "hold the part by its datums": ("pose-and-wear.html#a-datum-system", "datum"),
    "is the repair good": ("inspect.html", "missing"),
    "STEP with the original faces": ("exact-step.html", "offset of the part's faces"),
    "Sinumerik": ("machines.html", "sinumerik"),
    "does the nozzle collide": ("paths.html", "clearance"),
    "a hundred parts over night": ("batch.html", "damageest batch"),
    "write my own file format": ("plugin-guide.html", "Writer"),
    "test my plugin": ("plugin-guide.html", "conformance"),
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    browser.find_browser()
    pytest.importorskip("material", reason="mkdocs-material is not installed")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    env = {**os.environ, "DAMAGEEST_NOTEBOOKS": "no", "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser.open_browser() as opened:
        yield opened


@pytest.fixture
def page(site: Path, chromium: Any) -> Iterator[Any]:
    """The start page from disk; what it fetches from elsewhere, and its errors, are kept in ``page.faults``."""
    opened = chromium.new_page(viewport={"width": 1400, "height": 900})
    faults: list[str] = []
    opened.on("pageerror", lambda error: faults.append(str(error)))
    opened.on(
        "request", lambda one: None if one.url.startswith(("file:", "data:", "blob:")) else faults.append(one.url)
    )
    opened.goto((site / "index.html").as_uri())
    yield opened
    opened.close()
    assert not faults, "nothing is loaded from elsewhere"


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_question_is_answered_in_two_clicks(question: str, page: Any) -> None:
    address, said = QUESTIONS[question]
    page.keyboard.press("/")  # goes to the field
    page.keyboard.type(question)
    page.wait_for_selector(".md-search-result__item")
    page.wait_for_timeout(1000)
    item = page.locator(".md-search-result__item", has=page.locator(f"a[href*='{address.partition('#')[0]}']"))
    shown = page.locator(".md-search-result__item").all()[:SHOWN]
    hrefs = [link.get_attribute("href") or "" for one in shown for link in one.locator("a").all()]
    name, _, anchor = address.partition("#")
    found = next(
        (href for href in hrefs if f"/{name}" in f"/{href}" and href.endswith(f"#{anchor}" if anchor else "")), ""
    )
    assert found, f"{address} is not among {hrefs}"
    link = item.locator(f"a[href='{found}']").first
    if not link.is_visible():
        item.first.locator("summary").first.click()
    link.click()
    page.wait_for_url(f"**/{name}*")
    assert said in page.locator("article").inner_text()
