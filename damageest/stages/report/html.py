"""The report as one HTML page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from damageest.stages.report import Report, ReportFiles

if TYPE_CHECKING:
    from damageest.result import Result


class Html(Report):
    """One page, `report.html`, that a browser opens from disk without a network: sites, 3D view, sections, checks."""

    use: Literal["html"] = "html"
    points: int = Field(
        120_000,
        ge=1000,
        le=1_000_000,
        description="most scan points that the 3D view shows; the others are thinned out",
    )
    triangles: int = Field(
        120_000, ge=1000, le=1_000_000, description="about how many triangles the 3D view shows; meshes are simplified"
    )

    def run(self, result: Result, folder: Path, content: Mapping[str, Any], job_text: str) -> ReportFiles:
        """Writes ``report.html`` into ``folder``."""
        from damageest.stages.report._page import fill_page
        from damageest.stages.report._scene import build_scene
        from damageest.stages.report._sites import Remains, choose_overview, describe_sites

        scene, remains = build_scene(result, self.points, self.triangles), Remains(result)
        sites = describe_sites(result, content, remains)
        page = fill_page(result, content, job_text, scene, sites, choose_overview(result, remains))
        (folder / "report.html").write_text(page, encoding="utf-8")
        picture = next((site.picture for site in sites if site.picture), b"")
        return ReportFiles(("report.html",), picture=picture)
