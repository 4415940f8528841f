"""The PDF of the report: what is on its pages, in which language, and that the same job gives the same bytes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import damageest
from damageest.errors import JobError
from damageest.job import load
from damageest.registry import Registry
from damageest.stages.report._words import FOLDER, Words, list_languages
from damageest.trust.interval import budget
from damageest.trust.terms import list_terms
from tests import damaged_box
from tests.needs import import_or_skip

pypdfium2 = import_or_skip("pypdfium2")
import_or_skip("reportlab")

SETTING = "report: {{use: html, pdf: yes, company: Müller & Söhne, language: {}}}\nsections: [{{y: 0}}]\n"
SMALL = damaged_box.JOB.replace("report: none\n", "").replace("0.2", "0.4")
REPORT = Path(damageest.__file__).parent / "stages/report"


def run(job: Path, language: str) -> list[str]:
    """The text of each page."""
    job.write_text(SMALL + SETTING.format(language))
    damageest.run(job, output=True)
    document = pypdfium2.PdfDocument(job.parent / "out/job/report.pdf")
    return [page.get_textpage().get_text_range() for page in document]


@pytest.mark.slow
def test_the_pdf_has_a_summary_sections_and_a_page_for_each_site(small_done: Path) -> None:
    summary, sections, site, budget = run(small_done, "en")
    for text in (
        "Müller & Söhne",
        "1 site: 1",
        "damage volume",
        "95 % interval",
        "SHA-256",
        "released by",
        "page 1 of 4",
    ):
        assert text in summary, text
    assert "line profile" in sections
    assert "Site 1" in site
    assert "Budget of uncertainty: volume" in site + budget
    assert "Budget of uncertainty: depth" in budget
    assert "combined standard uncertainty" in budget


@pytest.mark.slow
def test_the_pdf_in_german_and_in_english_again(small_done: Path) -> None:
    run(small_done, "en")
    first = (small_done.parent / "out/job/report.pdf").read_bytes()
    german = run(small_done, "de")
    assert "Schadensbericht" in german[0]
    assert "Seite 1 von 4" in german[0]
    assert "kombinierte Standardunsicherheit" in german[3]
    assert re.search(r"Toleranz\s+0,40+ mm", german[0])
    run(small_done, "en")
    assert (small_done.parent / "out/job/report.pdf").read_bytes() == first


def test_every_text_of_page_and_pdf_is_in_each_catalogue() -> None:
    pofile = import_or_skip("babel.messages.pofile")
    texts = {*(term.text for term in list_terms()), *budget.UNKNOWN.values(), "normal", "rectangular"}
    texts |= set(re.findall(r'BudgetBound\("\w+", "([^"]*)"', Path(budget.__file__).read_text()))
    for path in REPORT.rglob("*.py"):
        source = path.read_text()
        texts |= set(re.findall(r'(?:tell|N_)\(\s*"((?:[^"\\]|\\.)*)"', source))
        texts |= set(re.findall(r"count\(\s*[\"']([^\"']*)", source))
    for path in REPORT.rglob("*.html"):
        texts |= set(re.findall(r'\bt\("([^"]*)"', path.read_text()))
    assert len(texts) > 200
    for language in list_languages()[1:]:
        with (FOLDER / language / "LC_MESSAGES/damageest.po").open("rb") as file:
            catalogue = pofile.read_po(file)
        known = {m.id if isinstance(m.id, str) else m.id[0]: m.string for m in catalogue if m.id}
        assert not texts - set(known)
        words = Words(language)
        for text, told in known.items():  # the compiled catalogue is that of the text file
            if isinstance(told, str):
                assert words.tell(text) == told
        legend = "section through the deepest point; grey: part as designed, red: damage, green: scan points"
        assert len(words.tell(legend)) <= 90, "a longer line is cut"


def test_a_language_without_a_catalogue_is_a_fault_of_the_job(tmp_path: Path) -> None:
    job = damaged_box.write_small(tmp_path)
    with pytest.raises(JobError, match="no catalogue of the language 'fr'; there are: en, de"):
        load(job, Registry.discover(), ["report.use=html", "report.language=fr"])
