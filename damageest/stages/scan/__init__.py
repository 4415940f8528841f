"""Stage `scan`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Part, Scan
from damageest.stages import Stage


class ReadScan(Stage, ABC):
    """Gives the scan, in the scanner's frame and the job's unit.

    ``unit``: the job's unit. ``part``: for virtual scanners only; a reader of files has no use for it. Raises
    InputError for a file that cannot be read or holds no points.
    """

    stage: ClassVar[str] = "scan"
    takes: ClassVar[Mapping[str, object]] = {"unit": str, "part": Part}
    gives: ClassVar[str] = "scan"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Scan: ...
