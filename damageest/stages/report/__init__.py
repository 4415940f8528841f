"""Stage `report`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from damageest.artefacts.fields import Checked
from damageest.result import Result
from damageest.stages import Stage, asked_by_name


@dataclass(frozen=True)
class ReportFiles(Checked):
    """What a report wrote. ``files``: paths relative to the output folder. ``notes``: omissions, with reasons.
    ``picture``: a PNG of the part with its damage, for a table of many runs; empty where there is none."""

    files: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    picture: bytes = b""


class Report(Stage, ABC):
    """Shows the result to people, beside the files of stage `export`. It runs last, where files are wanted.

    Args of ``run``:
        result: all that was computed, in the part's frame and in ``result.units``.
        folder: the output folder before it is moved to its final place. It holds the files of stage `export`.
        content: the content of result.json, as plain values. Its paths of inputs are relative to the final folder.
        job_text: the job as it ran, with every default, as YAML.

    Returns:
        The paths of all files written, relative to ``folder`` and with forward slashes. The same result gives the same
        bytes, but for dates and times, which stand together in one place.

    Raises:
        StageError: where no report can be made. The run goes on without it, and a warning says why.
        OSError: where a file cannot be written.

    Example::

        from pathlib import Path
        from typing import Literal
        from damageest.result import Result
        from damageest.stages.report import Report, ReportFiles

        class Sentence(Report):
            "A text file with one sentence."
            use: Literal["sentence"] = "sentence"

            def run(self, result: Result, folder: Path) -> ReportFiles:
                text = f"{len(result.sites)} sites, {result.damage_volume:.6g} {result.units}^3\\n"
                (folder / "report.txt").write_text(text)
                return ReportFiles(("report.txt",))
    """

    stage: ClassVar[str] = "report"
    gives: ClassVar[str] = "reported"

    @asked_by_name
    @abstractmethod
    def run(self, result: Result, folder: Path, content: Mapping[str, Any], job_text: str) -> ReportFiles: ...
