"""What a person sees when something is wrong. Each of these ends with words, and the app goes on."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from app_page import Page, mark, open_app, serve
from app_shop import make_job, write_plate

import damageest
from tests import damaged_box
from tests.stages.report.browser import WIDTHS, open_browser

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    """A folder with a plate and a scan of it that lacks a corner."""
    folder = tmp_path / "shop"
    folder.mkdir()
    write_plate(folder)
    return folder


def shoot(page: Page, name: str) -> None:
    page.shoot(f"fault-{name}")


def test_a_broken_scan_is_named_and_another_one_opens(shop: Path) -> None:
    (shop / "broken.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 5\n")
    with open_app(shop) as page:
        make_job(page, scan="broken.ply")
        page.wait("message", "broken.ply", 60)
        shoot(page, "broken")
        page.choose("scan", "scan.xyz")
        page.click("make")
        page.wait("part-facts", "mm", 60)


def test_a_wrong_unit_is_put_right_with_one_click(shop: Path) -> None:
    write_plate(shop, 0.1)
    with open_app(shop) as page:
        make_job(page)
        page.wait("unit-doubt", "wrong unit", 60)
        shoot(page, "unit")
        page.page.locator(mark("unit-offer"), has_text="the scan is in cm").click()
        page.wait("scan-facts", "40", 30)
        page.page.locator(mark("unit-doubt")).wait_for(state="detached")
    text = (shop / "plate.yaml").read_text()
    assert "unit: cm" in text
    assert "tolerance: auto" in text  # init had measured it in the wrong unit


def test_a_scan_of_another_part_is_refused_with_a_remedy(shop: Path) -> None:
    other = trimesh.creation.annulus(12, 20, 25).sample(20_000, seed=2)
    np.savetxt(shop / "other.xyz", other, fmt="%.4f")
    with open_app(shop) as page:
        make_job(page, scan="other.xyz")
        page.wait("part-facts", "mm", 60)
        page.run(120)
        page.wait("message", "try:")
        shoot(page, "part")
        assert "plate.yaml" in page.text("job-name")


def test_a_scan_that_lies_elsewhere_is_refused(shop: Path) -> None:
    np.savetxt(shop / "far.xyz", np.loadtxt(shop / "scan.xyz") + np.array([300, 0, 0]), fmt="%.4f")
    with open_app(shop) as page:
        make_job(page, scan="far.xyz")
        page.wait("part-facts", "mm", 60)
        job = shop / "plate.yaml"
        job.write_text(job.read_text().replace("align: register", "align: none    "))
        page.click("step-prepare")
        page.click("crop-piece")
        page.wait("message", "was changed by another program")  # the app overwrites nothing
        shoot(page, "conflict")
        page.click("reload")
        page.at_rest()
        page.run(120)
        page.wait("message", "none")
        shoot(page, "overlap")


@pytest.fixture
def mount(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """A file system of its own, of one megabyte; skips where none can be made."""
    place = tmp_path / "disk"
    place.mkdir()

    def make_disk(options: str) -> Path:
        command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)]
        if not shutil.which("mount") or subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("no file system can be mounted here")
        return place

    yield make_disk
    subprocess.run(["umount", "-l", str(place)], capture_output=True, check=False)


def test_a_full_disk_is_named(mount: Callable[[str], Path]) -> None:
    disk = mount("size=2500k")
    write_plate(disk)
    with open_app(disk) as page:
        make_job(page)
        page.wait("part-facts", "mm", 60)
        page.run(120)
        page.wait("message", "space")
        shoot(page, "disk")


def test_a_folder_without_rights_is_named(mount: Callable[[str], Path]) -> None:
    disk = mount("size=4m")
    write_plate(disk)
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    with open_app(disk) as page:
        page.page.get_by_text("This folder cannot be written to").wait_for()
        assert page.page.locator(mark("make")).is_disabled()
        shoot(page, "rights")


def test_stop_and_a_browser_that_closes_leave_the_app_and_the_run(shop: Path) -> None:
    with open_browser() as browser, serve(shop, "--idle", "2") as (process, address):
        page = Page(browser, address)
        make_job(page)
        page.wait("part-facts", "mm", 60)
        page.click("run")
        page.wait("stop")
        page.at_rest(1)
        page.click("stop")
        page.wait("message", "stopped in")
        shoot(page, "stopped")
        page.click("run")
        page.wait("stop")
        page.page.close()  # in the middle: the run goes on
        page = Page(browser, address)
        page.wait("stop")
        shoot(page, "closed")
        page.page.close()  # for good: the run goes on to its end, then the server ends
        end = time.monotonic() + 90
        while process.poll() is None and time.monotonic() < end:
            time.sleep(0.2)
        assert process.poll() == 0
    assert (shop / "out" / "plate" / "result.json").is_file()


def test_a_run_that_is_killed_leaves_the_app(shop: Path) -> None:
    with open_app(shop) as page:
        make_job(page)
        page.wait("part-facts", "mm", 60)
        page.click("run")
        page.wait("stop")
        page.at_rest(1.5)
        found = subprocess.run(["pgrep", "-f", f"main\\(\\) run {shop}"], capture_output=True, text=True, check=True)
        for number in found.stdout.split():
            os.kill(int(number), signal.SIGKILL)
        page.wait("message", "signal")
        page.run(120)
        page.wait("site")


def test_the_server_ends_after_its_last_tab(shop: Path) -> None:
    with open_browser() as browser, serve(shop, "--idle", "2") as (process, address):
        Page(browser, address).page.close()
        end = time.monotonic() + 30
        while process.poll() is None and time.monotonic() < end:
            time.sleep(0.2)
        assert process.poll() == 0


def test_without_the_token_nothing_is_answered(shop: Path) -> None:
    with serve(shop) as (_, address):
        place = address.split("/index")[0]
        for path in ("/index.html", "/download", "/index.html?token=guess", "/ws"):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(place + path)
        for name, value in (("Origin", "http://attacker.example"), ("Host", "attacker.example")):
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(urllib.request.Request(address, headers={name: value}))
        with urllib.request.urlopen(address) as answer:
            assert answer.headers["X-Frame-Options"] == "DENY"


def test_a_path_that_leaves_much_says_so_in_red_before_the_download(tmp_path: Path) -> None:
    """A bead of 5 mm in a pit of 12 mm: a tenth of the deposit is not filled."""
    nozzle = "{tip_radius: 2, length: 40, body_radius: 9}"
    path = f"path: {{use: layers, height: 2, width: 5, feed: 600, standoff: 8, nozzle: {nozzle}}}\n"
    job = damaged_box.write_small(tmp_path / "shop", path)
    damageest.run(job, output=True)
    with open_app(job.parent) as page:
        page.wait("part-facts", "mm", 60)
        page.at_rest()
        page.click("step-repair")
        page.click("repair-path")
        page.wait("path-fault", "of the deposit is not filled")
        page.click("repair-export")
        page.wait("path-left", "of the deposit is not filled")
        red = page.page.locator(mark("path-left")).evaluate("(one) => getComputedStyle(one).color")
        r, g, b = (int(value) for value in re.findall(r"\d+", red)[:3])
        assert r > 150 > max(g, b), red
        assert page.page.locator(mark("download")).is_visible()


BEYOND = """[...document.querySelectorAll('.v-btn, .v-field, .side, .stage, .head')]
  .filter(one => one.checkVisibility()).map(one => [one.className, one.getBoundingClientRect()])
  .filter(([, box]) => box.left < -1 || box.right > innerWidth + 1).map(([name]) => name)"""
"""What stands beyond the window."""


def test_it_fits_a_phone_and_wide_screens(shop: Path) -> None:
    with open_app(shop) as page:
        page.at_rest()
        for width in WIDTHS:
            page.page.set_viewport_size({"width": width, "height": 800})
            for step in ("open", "prepare", "align", "judge", "repair", "several"):
                page.click(f"step-{step}")
                page.page.wait_for_timeout(100)
                assert page.page.evaluate(BEYOND) == [], (width, step)
                assert page.page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0, (width, step)
