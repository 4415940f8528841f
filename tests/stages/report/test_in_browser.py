"""The page in a browser: it draws, its layers switch, rows and sites find each other, and it prints on A4."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import damageest
from damageest.artefacts import Mesh, Reason
from damageest.findings import Coverage, Surplus, UnseenRegion
from tests.stages.report import browser, pages


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser.open_browser() as found:
        yield found


@pytest.fixture(scope="module")
def shown(chromium: Any) -> browser.Shown:
    result = pages.two_sites()
    some = np.arange(200)
    weld = Surplus(1, some, 0.01, result.sites[0].damage, 0.4, 3.0)
    return browser.Shown(chromium, pages.write(replace(result, surplus=(weld,), coverage=hide_the_bottom(result))))


def hide_the_bottom(result: damageest.Result) -> Coverage:
    """A coverage in which no scanner saw the bottom of the part."""
    part = result.part
    hidden = part.face_normals[:, 2] < -0.9
    area = float((np.linalg.norm(part.cross, axis=1) / 2)[hidden].sum())
    box = part.vertices[part.faces[hidden]].reshape(-1, 3)
    region = UnseenRegion(area, box.mean(axis=0), np.stack([box.min(axis=0), box.max(axis=0)]), (), 1.0, "hidden")
    skin = Mesh(part.vertices, part.faces)
    no = np.zeros(len(hidden), bool)
    return Coverage(1 - area / part.area, (region,), skin, ~hidden, np.zeros(len(hidden)), no, np.where(hidden, 0, -1))


def count_changed(before: np.ndarray, after: np.ndarray) -> int:
    return int((np.abs(before - after).sum(axis=2) > 30).sum())


def check_drawn(report: browser.Shown) -> None:
    """Checks that the page has no fault and draws the damage, and closes it."""
    before = report.picture()
    report.switch("damage", False)
    assert count_changed(before, report.picture()) > 20
    assert not report.faults
    report.page.close()


@pytest.mark.slow
def test_no_fault_and_no_request(shown: browser.Shown) -> None:
    assert not shown.faults


@pytest.mark.slow
def test_no_other_script_runs_and_nothing_is_fetched(chromium: Any) -> None:
    """What a text of a plugin could bring into the page: a script, a handler, a picture from elsewhere."""
    path = pages.write(pages.two_sites())
    page = path.read_text(encoding="utf-8")
    foreign = "<script>window.ran = 1</script><img src='file:///nothing.png' onerror='window.ran = 2'>"
    assert page.count("<header>") == 1
    path.write_text(page.replace("<header>", f"<header>{foreign}"), encoding="utf-8")
    shown = browser.Shown(chromium, path)
    assert shown.page.evaluate("window.ran") is None
    assert sum("Content Security Policy" in text for text in shown.faults) == 3, shown.faults
    shown.page.close()


@pytest.mark.slow
def test_each_layer_draws_and_switches(shown: browser.Shown) -> None:
    for box in shown.page.locator("input.layer").all():
        box.uncheck()
    shown.settle()
    empty = shown.picture()
    for layer in ("part", "scan", "points", "damage", "surface", "deposit", "surplus", "unseen", "least"):
        shown.switch(layer, True)
        assert count_changed(empty, shown.picture()) > 60, layer
        shown.page.uncheck(f"input[data-layer={layer}]")
    shown.settle()
    assert count_changed(empty, shown.picture()) < 20
    shown.switch("part", True)
    shown.switch("damage", True)
    assert not shown.faults


@pytest.mark.slow
def test_the_colour_bar_comes_with_the_scan(shown: browser.Shown) -> None:
    for on in (True, False):
        shown.switch("scan", on)
        assert shown.page.is_visible("#scale") == on


@pytest.mark.slow
def test_a_site_can_be_hidden(shown: browser.Shown) -> None:
    before = shown.picture()
    shown.page.uncheck("input.site[data-site='1']")
    shown.settle()
    assert count_changed(before, shown.picture()) > 50
    shown.page.check("input.site[data-site='1']")


@pytest.mark.slow
def test_a_click_on_a_row_flies_to_the_site(shown: browser.Shown) -> None:
    result = pages.two_sites()
    for site in result.sites:
        before = shown.camera()
        shown.page.click(f"#row-{site.id} td:nth-child(3)")
        shown.settle()
        after = shown.camera()
        assert np.linalg.norm(after[:3] - before[:3]) > 1
        centre = site.damage.bounds.mean(axis=0) - result.part.bounds.mean(axis=0)
        assert after[3:] == pytest.approx(centre, abs=0.05)
        assert "chosen" in shown.page.get_attribute(f"#row-{site.id}", "class")
    shown.page.click("#fit")
    shown.settle()
    assert shown.camera()[3:] == pytest.approx(np.zeros(3), abs=1e-6)


@pytest.mark.slow
def test_a_click_on_a_site_shows_its_row(shown: browser.Shown) -> None:
    shown.page.click("#row-1 td:nth-child(3)")  # the site is now in the middle of the picture
    shown.settle()
    shown.page.evaluate("for (const row of document.querySelectorAll('#sites tr')) row.classList.remove('chosen')")
    canvas = shown.page.locator("#canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    shown.page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    shown.page.wait_for_selector("#row-1.chosen", timeout=5000)
    shown.page.click("#fit")


@pytest.mark.slow
def test_the_plane_clips(shown: browser.Shown) -> None:
    shown.page.select_option("#clip-axis", "2")
    shown.settle()
    half = shown.picture()
    assert re.fullmatch(r"z = -?[\d.e-]+ mm", shown.page.inner_text("#clip-text"))
    shown.page.select_option("#clip-axis", "")
    shown.settle()
    assert count_changed(half, shown.picture()) > 200


@pytest.mark.slow
def test_a_section_has_outline_and_points(shown: browser.Shown) -> None:
    for site in (1, 2):
        for name in (
            "part-as-designed",
            "damage-volume",
            "inner-damage-surface",
            "scan-points",
            "ruler",
            "deepest-point",
        ):
            box = shown.page.locator(f"#section-{site}-{name}").bounding_box()
            assert box, name
            assert box["width"] + box["height"] > 2, name
        assert shown.page.locator(f"#section-{site}-scan-points use").count() > 20


@pytest.mark.slow
def test_in_the_dark_on_a_tablet_and_on_paper(chromium: Any) -> None:
    report = browser.Shown(chromium, pages.write(pages.two_sites()), "#site-2", color_scheme="dark")
    assert "chosen" in report.page.get_attribute("#row-2", "class")
    assert report.picture()[:5, :5].mean() < 60
    ink = report.page.evaluate("getComputedStyle(document.querySelector('#section-1-part-as-designed path')).stroke")
    assert min(int(x) for x in re.findall(r"\d+", ink)[:3]) > 200
    for width in (1100, 768, 420):
        report.page.set_viewport_size({"width": width, "height": 900})
        assert report.page.evaluate("document.documentElement.scrollWidth") <= width
    report.page.emulate_media(media="print")
    report.page.set_viewport_size({"width": 688, "height": 1000})  # A4 less its margins, at 96 pixels an inch
    assert report.page.evaluate("document.documentElement.scrollWidth") <= 688
    assert not report.page.is_visible("#tools")
    report.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert report.page.is_visible("#run pre"), "the job is printed"
    data = report.page.pdf(prefer_css_page_size=True).decode("latin-1")
    for found in re.findall(r"/MediaBox ?\[([^\]]*)\]", data):
        assert [float(x) for x in found.split()] == pytest.approx([0, 0, 595, 842], abs=1.5)
    assert not report.faults
    report.page.close()


@pytest.mark.slow
def test_the_form_is_exaggerated_by_a_slider(chromium: Any) -> None:
    report = browser.Shown(chromium, pages.write(pages.sheared()))
    slider = report.page.locator("#exaggerate")
    assert not slider.is_visible()
    report.switch("part", False)
    report.switch("damage", False)
    report.switch("form", True)
    assert slider.is_visible()

    def measure(factor: int) -> tuple[np.ndarray, float]:
        """The picture, and how high the drawn form is."""
        slider.evaluate(f"(one) => {{ one.value = {factor}; one.dispatchEvent(new Event('input')); }}")
        report.settle()
        item = next(one["id"] for one in report.page.evaluate("report.scene.objects") if one["layer"] == "form")
        heights = report.page.evaluate(
            f"(() => {{ const g = report.view3d.getObjectById({item}).geometry; g.computeBoundingBox();"
            " return g.boundingBox.max.z - g.boundingBox.min.z; })()"
        )
        return report.picture(), float(heights)

    straight, low = measure(0)
    assert report.page.inner_text("#exaggerate-text") == "as designed"
    sheared, high = measure(30)
    assert report.page.inner_text("#exaggerate-text") == "30 times"
    part = pages.two_sites().part
    assert low == pytest.approx(float(np.ptp(part.vertices[:, 2])), abs=0.01)
    assert high - low == pytest.approx(2 * 30 * 0.4, rel=0.05)
    assert count_changed(straight, sheared) > 500
    assert not report.faults
    report.page.close()


@pytest.mark.slow
def test_without_sites_and_with_markup_in_every_name(chromium: Any) -> None:
    nasty, result = pages.NASTY, pages.two_sites()
    none = replace(result, sites=(), damage=None, undamaged=result.part, site_label=np.zeros_like(result.site_label))
    told = replace(none, name=nasty, warnings=(Reason("align", nasty),), failures=(nasty,))
    report = browser.Shown(chromium, pages.write(told, job_text=nasty))
    assert report.page.title() == f"{nasty} – damage report"
    assert not report.faults
    assert report.page.locator("#sites").count() == 0
    report.page.close()


@pytest.mark.slow
def test_an_incomplete_run_says_so(chromium: Any) -> None:
    result = pages.two_sites()
    told = replace(result, sites=result.sites[:1], failures=("boolean: manifold (site 2): it failed",))
    report = browser.Shown(chromium, pages.write(told))
    assert "incomplete: 1 failed" in report.page.inner_text("body")
    assert report.page.locator("#sites tbody tr").count() == 1
    check_drawn(report)


@pytest.mark.slow
def test_a_million_points(chromium: Any) -> None:
    path = pages.write(pages.two_sites(1_000_000))
    assert path.stat().st_size < 15e6
    report = browser.Shown(chromium, path)
    empty = report.picture()
    report.switch("scan", True)
    assert count_changed(empty, report.picture()) > 5000
    check_drawn(report)


@pytest.fixture(scope="module")
def twelve(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a part with twelve sites, one of them with a budget."""
    return pages.twelve_sites(tmp_path_factory.mktemp("twelve"))


def check_layout(chromium: Any, path: Path, sites: int) -> None:
    """The page is as wide as its window, breaks no word of a table, and prints on six pages and one a site."""
    report = browser.Shown(chromium, path)
    for width in browser.WIDTHS:
        report.page.set_viewport_size({"width": width, "height": 900})
        shown = report.page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
        assert shown[0] <= shown[1], width
        assert report.page.evaluate(browser.BROKEN) == [], width
    report.page.emulate_media(media="print")
    report.page.set_viewport_size({"width": 688, "height": 1000})
    report.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert report.page.evaluate(browser.BROKEN) == [], "on paper"
    data = report.page.pdf(prefer_css_page_size=True)
    assert 1 <= len(re.findall(rb"/Type ?/Page\b", data)) <= 6 + sites
    report.page.close()


@pytest.mark.slow
def test_tables_break_no_word_and_a_print_is_short(chromium: Any, twelve: Path) -> None:
    check_layout(chromium, pages.write(pages.two_sites()), 2)
    check_layout(chromium, twelve, 12)


@pytest.mark.slow
def test_a_word_that_its_column_cuts_is_found(chromium: Any) -> None:
    report = browser.Shown(chromium, pages.write(pages.two_sites()))
    report.page.add_style_tag(content="#sites th { max-width: 3ch; overflow-wrap: anywhere; width: 3ch }"
                              "#sites { table-layout: fixed; width: 200px }")  # fmt: skip
    assert "verdict" in report.page.evaluate(browser.BROKEN)
    report.page.close()


@pytest.mark.slow
def test_twelve_sites(chromium: Any, twelve: Path) -> None:
    assert twelve.stat().st_size < 15e6
    report = browser.Shown(chromium, twelve)
    assert report.page.locator("#sites tbody tr").count() == 12
    for site in (1, 12):
        assert report.page.locator(f"#section-{site}-damage-volume").count() == 1
        before = report.camera()
        report.page.click(f"#row-{site} td:nth-child(3)")
        report.settle()
        assert np.linalg.norm(report.camera()[3:] - before[3:]) > 1
    check_drawn(report)


@pytest.mark.variants(slow=1)
@pytest.mark.slow
@pytest.mark.parametrize("job", sorted((Path(__file__).parents[3] / "jobs").glob("*.yaml")), ids=lambda path: path.stem)
def test_the_report_of_each_job(job: Path, chromium: Any, tmp_path: Path) -> None:
    damageest.run(job, output=tmp_path / "out")
    path = tmp_path / "out/report.html"
    assert path.stat().st_size < 15e6
    check_drawn(browser.Shown(chromium, path))
