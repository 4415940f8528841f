"""The page of a batch."""

from __future__ import annotations

import html
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from damageest.batches import page
from damageest.batches.page import keep_picture, write_page
from damageest.batches.rows import Row
from tests.batches.test_batch_files import EVIL, make_rows
from tests.stages.report import browser


def read_items(folder: Path) -> list[dict[str, Any]]:
    """The rows that the page holds, in its order."""
    text = (folder / "batch.html").read_text().split('<script type="application/json" id="rows">')[1]
    items: list[dict[str, Any]] = json.loads(html.unescape(text.split("</script>")[0]))
    return items


def test_page_is_escaped_and_needs_no_network(tmp_path: Path) -> None:
    report = tmp_path / "good/report.html"
    report.parent.mkdir()
    report.write_text("a report of a plugin, with no picture in it")
    keep_picture(report.parent, b"\x89PNG")
    write_page(make_rows(tmp_path), tmp_path)
    text = (tmp_path / "batch.html").read_text()
    assert "<script>alert" not in text
    assert "http" not in text.replace("http-equiv", "")
    good, bad = read_items(tmp_path)
    assert (good["link"], good["verdict"]) == ("good/report.html", "1 proven, 1 doubtful")
    assert good["picture"] == "data:image/png;base64,iVBORw=="
    assert (bad["name"], bad["error"]) == (EVIL, f"{EVIL} (2 tries)")
    keep_picture(report.parent, b"")
    write_page(make_rows(tmp_path), tmp_path)
    assert not read_items(tmp_path)[0]["picture"]


def test_pictures_past_the_size_of_a_page_stay_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "MOST_PICTURES", 1)
    rows = [Row(name, "job.yaml", str(tmp_path / name), "ok") for name in ("a", "b", "c")]
    keep_picture(tmp_path / "a", b"\x89PNG")
    keep_picture(tmp_path / "b", b"\x89PNG")
    write_page(rows, tmp_path)
    assert [item["picture"] for item in read_items(tmp_path)] == ["data:image/png;base64,iVBORw==", ".b.png", ""]


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser.open_browser() as opened:
        yield opened


@pytest.mark.slow
@pytest.mark.parametrize("count", [700, pytest.param(10_000, marks=pytest.mark.slow)])
def test_many_rows_in_a_browser(count: int, chromium: Any, tmp_path: Path) -> None:
    """Those to look at come first; others are drawn when they are scrolled to, searched for or sorted to the front."""
    good = {"verdicts": {"proven": 1}, "damage_volume": 2.0, "volume_95": (1.0, None), "units": "mm", "sites": 1}
    rows = [Row(f"job-{k}", "job.yaml", str(tmp_path / f"job-{k}"), "ok", seconds=k, **good) for k in range(count)]
    rows[count - 300] = Row(
        EVIL, "evil.yaml", str(tmp_path / "evil"), "refused", error="gone.ply: there is no such file"
    )
    rows[count - 200] = Row("doubted", "d.yaml", str(tmp_path / "d"), "ok", **{**good, "verdicts": {"doubtful": 1}})
    last = f"job-{count - 1}"
    write_page(rows, tmp_path)
    window = chromium.new_page(viewport={"width": 900, "height": 600})
    faults: list[str] = []
    window.on("console", lambda message: faults.append(message.text))
    window.on("pageerror", lambda error: faults.append(str(error)))
    window.goto((tmp_path / "batch.html").as_uri())
    lines = window.locator("tbody tr")
    drawn = lines.count()
    assert 0 < drawn < 500
    names = [text.split("\t")[1] for text in lines.all_inner_texts()[:3]]
    assert names == ["doubted", " ".join(EVIL.split()), "job-0"]
    assert "at least 1" in lines.first.inner_text()
    window.mouse.wheel(0, 1_000_000)
    window.wait_for_selector(f"tbody tr:nth-child({drawn + 1})")
    window.fill("input", "NO such file")
    assert lines.count() == 1
    window.fill("input", last)
    assert [text.split("\t")[1] for text in lines.all_inner_texts()] == [last]
    window.fill("input", "")
    for _ in range(2):
        window.click("th[data-key=seconds] button")
    assert lines.first.inner_text().split("\t")[1] == last
    assert not faults


@pytest.mark.slow
def test_it_fits_a_phone_and_paper(chromium: Any, tmp_path: Path) -> None:
    """However long names and paths are; no word of a table is cut, and paper has all rows."""
    good = {"verdicts": {"proven": 1, "doubtful": 2}, "damage_volume": 12345.6, "volume_95": (12300.0, 12400.0)}
    names = [f"turbine_blade_stage_3_serial_{k:05d}_before_repair" for k in range(120)]
    rows = [
        Row(name, "job.yaml", str(tmp_path / name), "ok", seconds=9.0, units="mm", sites=3, **good) for name in names
    ]
    gone = f"/share/{'long-folder/' * 12}scan_of_the_part.ply: there is no such file; give another path"
    rows[3] = Row("gone", "job.yaml", str(tmp_path / "gone"), "refused", error=gone)
    write_page(rows, tmp_path)
    window = chromium.new_page()
    window.goto((tmp_path / "batch.html").as_uri())
    window.wait_for_selector("tbody tr")
    size = "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"
    for width in browser.WIDTHS:
        window.set_viewport_size({"width": width, "height": 900})
        shown = window.evaluate(size)
        assert shown[0] <= shown[1], width
        assert window.evaluate(browser.BROKEN) == [], width
    window.emulate_media(media="print")
    window.set_viewport_size({"width": 688, "height": 1000})
    window.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert window.locator("tbody tr").count() == len(rows)
    assert window.evaluate(size)[0] <= 688
    assert window.evaluate(browser.BROKEN) == []
    window.close()
