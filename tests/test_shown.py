"""What is shown of damageest: a result in a notebook, the notebooks, the gallery, and the README's pictures."""

from __future__ import annotations

import html
import json
import re
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

import damageest
from damageest.cli import app
from damageest.errors import StageError
from damageest.job import load
from damageest.registry import Registry
from damageest.result import Result
from tests import damaged_box
from tests.needs import import_or_skip
from tests.stages.export import results

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
GALLERY = (ROOT / "docs" / "gallery.md").read_text()
IMAGES = ROOT / "docs" / "images"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    return damageest.run(damaged_box.write_small(tmp_path_factory.mktemp("shown"), ""))


def list_ids(html: str) -> set[str]:
    return set(re.findall(r'\bid="([^"]+)"', html))


def test_a_result_shows_its_sites_a_section_and_a_picture(result: Result, registry: Registry) -> None:
    html = result._repr_html_()
    assert html is not None
    assert f"{result.damage_volume:.4g}" in html.replace(",", "")
    assert result.sites[0].verdict.level in html
    assert "<svg" in html
    assert "damage-volume" in html
    assert 'src="data:image/png;base64,' in html
    assert "http" not in html.replace("http://www.w3.org/", ""), "nothing is loaded from elsewhere"
    for used in re.findall(r"url\(#([^)]+)\)|href=\"#([^\"]+)\"", html):
        assert set(filter(None, used)) <= list_ids(html), "a drawing refers to what is there"
    two = replace(results.make(), conversions=registry.conversions)
    other = two._repr_html_() or ""
    assert not list_ids(html) & list_ids(other), "two results on one page have no id in common"
    assert all(f"</span> {site.id}" in other for site in two.sites)
    assert len(html) < 300_000


def test_a_result_without_damage_shows_how_far_points_are(registry: Registry) -> None:
    html = replace(results.without_damage(), conversions=registry.conversions)._repr_html_() or ""
    assert "No damage deeper than the tolerance" in html
    assert "signed distance to the nominal surface" in html


def test_a_result_that_no_run_made_shows_its_text() -> None:
    assert results.make()._repr_html_() is None
    assert repr(results.make()).startswith("<Result two: sites: 1 ")


def test_without_pillow_the_section_stays_and_without_pyvista_the_extra_is_named(
    result: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    monkeypatch.setitem(sys.modules, "pyvista", None)
    monkeypatch.setattr("damageest.stages.report._notebook.find_spec", lambda name: None)
    html = result._repr_html_() or ""
    assert "<svg" in html
    assert "<img" not in html
    with pytest.raises(StageError, match=r"--extra vtk|damageest\[vtk\]"):
        result.plot()


@pytest.mark.slow
def test_plot_has_the_part_the_damage_and_the_scan(result: Result) -> None:
    plotter = result.plot(site=1, show=False)
    assert len(plotter.actors) >= 3
    with pytest.raises(damageest.errors.InputError, match="there is no site 9"):
        result.plot(site=9, show=False)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_without_outputs_and_its_links_lead_to_files(path: Path) -> None:
    cells = json.loads(path.read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    assert not [cell for cell in code if cell["outputs"] or cell["execution_count"]], "clear the outputs"
    text = "".join(line for cell in cells if cell["cell_type"] == "markdown" for line in cell["source"])
    for link in re.findall(r"\]\(([^)#:]+)", text):
        assert (path.parent / link).is_file(), f"{path.name} links to {link}"


def test_every_notebook_is_in_the_site() -> None:
    menu = (ROOT / "mkdocs.yml").read_text()
    assert len(NOTEBOOKS) == 6
    assert {path.stem for path in NOTEBOOKS} == set(re.findall(r"notebooks/(\w+)\.md", menu))


CASES = re.findall(r"^```sh\ndamageest run (\S+)\n```$", GALLERY, re.MULTILINE)


def test_each_case_of_the_gallery_has_its_job_its_picture_and_what_was_found(registry: Registry) -> None:
    assert len(CASES) == 10
    kept = json.loads((IMAGES / "gallery" / "gallery.json").read_text())
    assert [Path(case).stem for case in CASES] == [name for name in kept if name in {Path(c).stem for c in CASES}]
    for case in CASES:
        name = Path(case).stem
        assert load(ROOT / case, registry).name == name
        assert f"(images/gallery/{name}.png)" in GALLERY
        assert (IMAGES / "gallery" / f"{name}.png").stat().st_size < 60_000
        assert all(site in GALLERY for site in kept[name]["sites"])
        assert kept[name]["total"] in GALLERY


@pytest.mark.variants(slow=2)
@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_case_of_the_gallery_gives_what_the_page_says(case: str, tmp_path: Path) -> None:
    done = damageest.run(ROOT / case, output=tmp_path / "out")
    said = json.loads((IMAGES / "gallery" / "gallery.json").read_text())[Path(case).stem]
    assert len(done.sites) == len(said["sites"])
    for site, words in zip(done.sites, said["sites"], strict=True):
        assert f"**{site.verdict.level}**" in words
        number = words.split()[0]
        digit = 10.0 ** -len(number.partition(".")[2])
        assert site.damage.volume == pytest.approx(float(number), rel=1e-3, abs=0.5 * digit)


def test_the_readme_is_short_and_its_pictures_are_small_and_true() -> None:
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= 150
    assert (IMAGES / "in-and-out.png").stat().st_size < 200_000
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        assert (ROOT / picture).is_file(), "a badge or picture of this repository, of no service"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    words = {
        "licence": project["project"]["license"],
        "python": project["project"]["requires-python"].replace(">=", "≥ "),
        "types": "mypy strict" if project["tool"]["mypy"]["strict"] else "mypy",
    }
    for name, said in words.items():
        badge = (IMAGES / f"badge-{name}.svg").read_text()
        ElementTree.fromstring(badge)
        assert f">{said}</text>" in badge, "make it anew: python docs/pictures/make_readme.py badges"


def test_the_recording_shows_the_volume_of_the_readme_and_loads_nothing() -> None:
    drawn = (IMAGES / "run.svg").read_text()
    ElementTree.fromstring(drawn)
    assert not re.sub(r"https?://(www\.w3\.org|www\.textualize\.io)\S*", "", drawn).count("http")
    (shown,) = re.findall(r"^damage volume: (\S+) mm³", (ROOT / "README.md").read_text(), re.MULTILINE)
    assert shown in drawn
    assert "/work/" not in drawn
    assert "/home/" not in drawn


@pytest.mark.slow
def test_lost_metal_cut_back_and_stock_stand_wherever_a_result_is_shown(small_done: Path) -> None:
    """In the terminal, the report, the PDF, the notebook and the app: the same three numbers."""
    pdf = import_or_skip("pypdfium2")
    app_results = import_or_skip("damageest_app.running.results")
    text = small_done.read_text().replace("report: none", "report: {use: html, pdf: true}")
    small_done.write_text(text + "allowance: {use: milling, outer: 0.5, inner: 0.4}\n")
    done = CliRunner().invoke(app, ["run", str(small_done)])
    assert done.exit_code == 0, done.output
    result = damageest.run(small_done, output=True)
    told = result.describe_volumes()
    assert re.fullmatch(r"lost metal [0-9.]+ mm³, cut-back [0-9.]+ mm³, stock [0-9.]+ mm³", told)
    assert result.lost_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.03)
    assert told in " ".join(done.output.split())
    folder = small_done.parent / "out/job"
    for page in ((folder / "report.html").read_text(), result._repr_html_()):
        assert told in " ".join(html.unescape(re.sub("<[^>]+>", " ", page)).split())
    book = pdf.PdfDocument(folder / "report.pdf")
    printed = " ".join(book[0].get_textpage().get_text_range().split())
    book.close()
    assert all(part in printed for part in told.split(", "))
    content = json.loads((folder / "result.json").read_text())
    assert app_results.Results._describe_volumes(SimpleNamespace(content=content, unit="mm")) == told
