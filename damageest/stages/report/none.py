"""No report."""

from __future__ import annotations

from typing import Literal

from damageest.stages.report import Report, ReportFiles


class NoReport(Report):
    """Writes no report. For many runs whose results programs read."""

    use: Literal["none"] = "none"

    def run(self) -> ReportFiles:
        """No files."""
        return ReportFiles()
