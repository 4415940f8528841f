"""The report as one HTML page, and as a PDF."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from damageest.errors import describe_install
from damageest.stages import JobPath
from damageest.stages.report import Report, ReportFiles

if TYPE_CHECKING:
    from damageest.result import Result


class Html(Report):
    """One page, `report.html`: sites, 3D view, sections and checks. It opens from disk, without a network.

    `report.pdf` has the same on paper, to be signed.
    """

    use: Literal["html"] = "html"
    points: int = Field(
        120_000,
        ge=1000,
        le=1_000_000,
        description="most scan points that the 3D view shows; the others are thinned out",
    )
    triangles: int = Field(
        120_000, ge=1000, le=1_000_000, description="number of triangles in the 3D view, about; meshes are simplified"
    )
    pdf: bool = Field(False, description="whether `report.pdf`, A4, is written too; needs the extra `pdf`")
    company: str = Field("", max_length=80, description="name at the head of each page of the PDF")
    logo: JobPath | None = Field(None, description="PNG or JPEG file at the head of each page of the PDF")
    language: str = Field("en", description="language of page and PDF: en, de; reasons and notes are English")

    @field_validator("language")
    @classmethod
    def _check_language(cls, value: str) -> str:
        from damageest.stages.report._words import list_languages

        if value not in list_languages():
            raise ValueError(f"no catalogue of the language '{value}'; there are: {', '.join(list_languages())}")
        return value

    @model_validator(mode="after")
    def _check_pdf(self) -> Self:
        lacking = [module for module in ("reportlab", "k3d", "PIL") if self.pdf and find_spec(module) is None]
        if lacking:
            raise ValueError(f"pdf: needs the package {lacking[0]}; install it:  {describe_install('pdf')}")
        return self

    def find_faults(self, job: Mapping[str, Any], registry: Any) -> list[tuple[tuple[str | int, ...], str]]:
        """A logo that is no picture."""
        if not self.pdf or self.logo is None or not self.logo.is_file():
            return []
        with self.logo.open("rb") as stream:
            start = stream.read(8)
        if start.startswith((b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff")):
            return []
        return [(("logo",), f"{self.logo} is neither PNG nor JPEG; save it as one of them")]

    def run(self, result: Result, folder: Path, content: Mapping[str, Any], job_text: str) -> ReportFiles:
        """Writes ``report.html``, and ``report.pdf`` where the job wants it, into ``folder``."""
        from damageest.stages.report._page import fill_page
        from damageest.stages.report._sites import Remains, choose_overview, describe_sites
        from damageest.stages.report._words import Words
        from damageest.stages.report.scene.scene import build_scene

        words = Words(self.language)
        scene, remains = build_scene(result, self.points, self.triangles), Remains(result)
        sites = describe_sites(result, content, remains, words)
        start = choose_overview(result, remains)
        page = fill_page(result, content, job_text, scene, sites, start, words)
        (folder / "report.html").write_text(page, encoding="utf-8")
        files = ["report.html"]
        if self.pdf:
            from damageest.stages.report.pdf.book import Book, Letterhead
            from damageest.stages.report.pdf.document import write_pdf

            book = Book(result, content, job_text, words, Letterhead(self.company, self.logo))
            write_pdf(folder / "report.pdf", book, sites, remains, start)
            files.append("report.pdf")
        picture = next((site.picture for site in sites if site.picture), b"")
        return ReportFiles(tuple(files), picture=picture)


def show_in_notebook(result: Result, what: str, site: int | None) -> str:
    """The result as a piece of HTML with table, sections and a picture: the conversion `html` of `Result.convert`."""
    from damageest.stages.report._notebook import make_snippet

    return make_snippet(result)


def open_plotter(result: Result, what: str, site: int | None) -> Any:
    """A ``pyvista.Plotter`` with the result: the conversion `plotter` of `Result.convert`."""
    from damageest.stages.report._plot import make_plotter

    return make_plotter(result, site, what == "window")
