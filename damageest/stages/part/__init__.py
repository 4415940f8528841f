"""Stage `part`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Part
from damageest.stages import Stage


class ReadPart(Stage, ABC):
    """Gives the part as designed, in the job's unit.

    ``unit``: the job's unit. ``tolerance``: lambda, or None where it is still to be measured from the scan.
    ``reads`` names the file suffixes (lower case, with the dot) that an implementation with a ``path`` option
    reads: a bare path in the job picks the implementation by it. Raises InputError for a file that is not a solid
    and cannot safely be made one.
    """

    stage: ClassVar[str] = "part"
    takes: ClassVar[Mapping[str, object]] = {"unit": str, "tolerance": float | None}
    gives: ClassVar[str] = "part"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> Part: ...
