"""The page as text: what it holds, that it needs nothing else, and that it is the same twice."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import damageest
from damageest.artefacts import Pose, Reason
from damageest.findings import Verdict
from damageest.stages.report.html import Html
from tests.path_shapes import dent, plan
from tests.stages.report import pages

DATES = re.compile("<!-- dates and times: begin -->.*?<!-- dates and times: end -->", re.DOTALL)


class Page(HTMLParser):
    """The tags of a page with their attributes, and its text outside of scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.words: list[str] = []
        self.inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        self.inside = tag

    def handle_data(self, data: str) -> None:
        if self.inside not in ("script", "style"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def text() -> str:
    return pages.write(pages.two_sites()).read_text()


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    return Page(text)


def test_it_needs_no_other_file(page: Page, text: str) -> None:
    for tag, attributes in page.tags:
        for name in ("src", "href", "xlink:href", "action", "data"):
            assert attributes.get(name, "#").startswith(("#", "data:")), (tag, attributes)
    style = text.split("<style>")[1].split("</style>")[0]
    assert "@import" not in style
    assert "url(" not in style


@pytest.mark.slow
def test_the_path_is_shown_layer_by_layer_with_its_tool_and_what_it_does_not_reach() -> None:
    path, plain = plan(dent(), simulate=False, direction=(0.0, 0.0, 1.0)), pages.two_sites()
    result = replace(plain, sites=(replace(plain.sites[0], path=path), plain.sites[1]))
    text = pages.write(result).read_text()
    found = re.search(r'<script type="application/json" id="scene">(.*?)</script>', text, re.DOTALL)
    assert found
    objects = [item for item in json.loads(found[1])["objects"] if item["site"] == 1]
    passes = [item for item in objects if item["layer"] == "path"]
    assert [item["height"] for item in passes] == [*range(1, path.layers + 1)]
    assert passes[-1]["minutes"] <= path.minutes * 1.01
    assert sorted(item["minutes"] for item in passes) == [item["minutes"] for item in passes]
    tools = [item["height"] for item in objects if item["layer"] == "tool" and item["alone"]]
    assert sorted(tools) == sorted(2 * [*range(1, path.layers + 1)])  # nozzle and beam
    assert sum(item["layer"] == "unreached" for item in objects) == 1


def test_it_shows_the_values_of_each_site(page: Page) -> None:
    result = pages.two_sites()
    for site in result.sites:
        assert f"{site.damage.volume:#.4g} mm³" in page.text
        assert f"damage/site-{site.id}.stl" in page.text
    assert "a part of its rim was not seen" in page.text
    assert "2 sites: 1 proven, 1 likely." in page.text


def test_no_fixed_text_of_the_page_bypasses_the_catalogue() -> None:
    names = {"sha", "part", "scan", "scanner", "temperature", "JCGM", "GUM"}  # of files, of the job, of a guide
    for path in (Path(damageest.__file__).parent / "stages/report/page").glob("*.html"):
        text = re.sub(r"<!--.*?-->|{%.*?%}|{{.*?}}", " ", path.read_text(), flags=re.DOTALL)
        attributes = re.findall(r'(?:aria-label|alt|title)="([^"]*)"', text)
        shown = " ".join([re.sub(r"<[^>]*>", " ", text), *attributes])
        words = set(
            re.findall(r"[^\W\d_]{3,}", re.sub(r"(?s)<style>.*?</style>|^\.bar .*?$", "", shown, flags=re.MULTILINE))
        )
        assert not words - names, path.name


@pytest.mark.slow
def test_the_page_in_german_has_the_same_values() -> None:
    english, german = (
        Page(DATES.sub("", pages.write(pages.two_sites(), stage=Html(language=one)).read_text())).text
        for one in ("en", "de")
    )
    for text in ("2 Stellen: 1 nachgewiesen, 1 wahrscheinlich.", "Schadensvolumen", "Rauschen", "In 3D zeigen"):
        assert text in german, text
    assert sorted(re.findall(r"\d+\.\d+", german)) == sorted(re.findall(r"\d+\.\d+", english))


def test_every_picture_has_a_text(page: Page) -> None:
    pictures = [attributes for tag, attributes in page.tags if tag == "img"]
    assert len(pictures) >= 2 * 4
    assert all(attributes.get("alt") for attributes in pictures)
    sections = [a for tag, a in page.tags if tag == "figure" and a.get("class") == "section"]
    assert len(sections) == 2
    assert all(a["role"] == "img" and a["aria-label"] for a in sections)


def test_ids_are_given_once(page: Page) -> None:
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))


@pytest.mark.slow
def test_same_bytes_twice_but_for_dates(text: str) -> None:
    assert DATES.sub("", text) == DATES.sub("", pages.write(pages.two_sites()).read_text())
    assert len(DATES.findall(text)) == 1


@pytest.mark.slow
def test_markup_in_names_and_messages_does_no_harm(tmp_path: Path, page: Page) -> None:
    nasty, result = pages.NASTY, pages.two_sites()
    sites = tuple(
        replace(s, verdict=Verdict("doubtful", (Reason("pose", nasty),)), warnings=(Reason("x", nasty),))
        for s in result.sites
    )
    part = replace(result.part, path=str(tmp_path / nasty.replace("/", "")), notes=(nasty,))
    told = replace(result, name=nasty, sites=sites, part=part, warnings=(Reason("x", nasty),), failures=(nasty,))
    text = pages.write(replace(told, pose=Pose(np.eye(4), notes=(nasty,))), job_text=nasty).read_text()
    count = {tag: sum(t == tag for t, _ in page.tags) for tag in ("script", "img")}
    found = Page(text)
    assert {tag: sum(t == tag for t, _ in found.tags) for tag in count} == count
    assert not [a for _, a in found.tags if any(name.startswith("on") for name in a)]
    assert found.text.count("onerror") >= 9


@pytest.mark.parametrize("kind", ["none", "incomplete"])
def test_runs_without_sites(kind: str) -> None:
    result = pages.two_sites()
    none = replace(result, sites=(), damage=None, undamaged=result.part, site_label=np.zeros_like(result.site_label))
    if kind == "incomplete":
        none = replace(none, failures=("boolean: manifold (site 1): it failed",))
    text = Page(pages.write(none).read_text()).text
    assert ("No damage deeper than the tolerance" in text) == (kind == "none")
    assert ("it failed" in text) == (kind == "incomplete")


@pytest.mark.slow
def test_many_points_and_triangles_stay_small() -> None:
    result, limit = pages.two_sites(), Html(points=2000, triangles=2000)
    small, usual = pages.write(result, stage=limit), pages.write(result)
    assert small.stat().st_size < usual.stat().st_size < 15e6
    shown = re.search(r"(\d+) of 12.000 points", Page(small.read_text()).text)
    assert shown
    assert 1000 < int(shown[1]) <= 2000


@pytest.mark.slow
def test_the_run_writes_it_and_names_it(small_done: Path) -> None:
    out = small_done.parent / "out/job"
    result = damageest.run(small_done, output=True, settings=["report=html"])
    assert (out / "report.html").stat().st_size > 1e6
    assert '"report.html"' in (out / "result.json").read_text()
    assert [record.use for record in result.stages][-1] == "html"
    damageest.run(small_done, output=True)
    assert not (out / "report.html").exists()


@pytest.mark.slow
def test_a_report_that_fails_is_a_warning(small_done: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ValueError("no such colour")

    monkeypatch.setattr("damageest.stages.report.scene.scene.build_scene", fail)
    result = damageest.run(small_done, output=True, settings=["report=html"])
    written = small_done.parent / "out/job/result.json"
    assert [note for note in result.warnings if note.code == "report" and "no such colour" in note.text]
    assert "no such colour" in written.read_text()
