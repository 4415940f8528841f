"""Stage `align`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Part, Pose, Samples, Scan
from damageest.stages import Stage


class Align(Stage, ABC):
    """Gives the pose of the scan in the part's frame (paper 3.1 step 3).

    Raises StageError where no pose explains the scan; says in the pose where several do.
    """

    stage: ClassVar[str] = "align"
    takes: ClassVar[Mapping[str, object]] = {"scan": Scan, "part": Part, "samples": Samples, "tolerance": float}
    gives: ClassVar[str] = "pose"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Pose: ...
