"""Stage `export`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from damageest.stages import Stage


class Export(Stage, ABC):
    """Writes the result into a folder that the engine made and will move into place (end of paper 3.2).

    ``result``: everything computed. ``folder``: an existing, empty folder. Gives the files' paths relative to it.
    """

    stage: ClassVar[str] = "export"
    takes: ClassVar[Mapping[str, object]] = {"result": "Result", "folder": Path}
    gives: ClassVar[str] = "files"

    @abstractmethod
    def run(self, *args: Any, **kwargs: Any) -> tuple[str, ...]: ...
