"""Stage `align`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Part, Pose, Samples, Scan
from damageest.stages import Stage, asked_by_name


class Align(Stage, ABC):
    """Gives the pose of the scan in the part's frame (paper 3.1 step 3).

    Raises StageError where no pose explains the scan; says in the pose where several do.
    """

    stage: ClassVar[str] = "align"
    gives: ClassVar[str] = "pose"

    @asked_by_name
    @abstractmethod
    def run(self, scan: Scan, part: Part, samples: Samples, tolerance: float) -> Pose: ...
