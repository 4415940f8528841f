"""Stage `scan`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Scan
from damageest.stages import Stage, asked_by_name


class ReadScan(Stage, ABC):
    """Gives the scan, in the scanner's frame and the job's unit.

    ``unit``: the job's unit. ``part``: for virtual scanners only; a reader of files has no use for it. Raises
    InputError for a file that cannot be read or holds no points.
    """

    stage: ClassVar[str] = "scan"
    gives: ClassVar[str] = "scan"

    @asked_by_name
    @abstractmethod
    def run(self, unit: str, part: Part) -> Scan: ...
