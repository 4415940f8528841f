"""Stage `scan`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field

from damageest.artefacts import Part, Scan
from damageest.geometry.crops import AnyCrop
from damageest.stages import Stage, asked_by_name


class ReadScan(Stage, ABC):
    """Reads the scan from files, or makes one.

    ``reads``: the file suffixes, in lower case with the dot, that an implementation with an option ``path`` reads. A
    bare path in the job chooses the implementation by its suffix. Every implementation has the option ``crop``; the
    pipeline applies it to the output of ``run``.

    Args of ``run``:
        unit: the job's unit, one of um, mm, cm, m, in, ft.
        part: the part as designed, for a virtual scanner. A reader of files does not ask for it.

    Returns:
        N points (N,3), finite, in the scanner's frame and in ``unit``; outward ``normals`` (N,3), or None where the
        file has none; ``viewpoints`` (V,3) and ``view`` (N,) where the scanner's positions are known. Leave ``noise``
        and ``spacing`` at 0: they are measured afterwards. A virtual scanner adds the ``truth``: the true damage in the
        part's frame, and the true pose.

    Raises:
        InputError: where a file cannot be read or holds no points. Begin the message with the file's name.
        StageError: where a virtual scanner cannot scan the part as its options say.

    Example::

        from typing import ClassVar, Literal
        import numpy as np
        from pydantic import Field
        from damageest.artefacts import Scan
        from damageest.errors import InputError
        from damageest.stages import JobPath
        from damageest.stages.scan import ReadScan

        class GzipText(ReadScan):
            "A scan from compressed text with columns x, y and z, in the job's unit."
            use: Literal["gzip_text"] = "gzip_text"
            reads: ClassVar[tuple[str, ...]] = (".gz",)
            path: JobPath = Field(description="the file, relative to the job's folder")

            def run(self, unit: str) -> Scan:
                try:
                    points = np.loadtxt(self.path, usecols=(0, 1, 2), ndmin=2)
                except (OSError, EOFError, ValueError) as error:
                    raise InputError(f"{self.path}: not readable as compressed text ({error})") from None
                if not len(points) or not np.isfinite(points).all():
                    raise InputError(f"{self.path}: holds no points, or points that are not finite")
                return Scan(points, unit=unit, paths=(str(self.path),))
    """

    stage: ClassVar[str] = "scan"
    gives: ClassVar[str] = "scan"

    crop: tuple[AnyCrop, ...] = Field(
        (),
        description="points to keep or to drop, one crop after the other; in the scan's own frame, in the job's unit",
    )

    @property
    def finds_scale(self) -> bool:
        """Whether a scan that is larger or smaller than the part is to be scaled by the factor that fits best."""
        return False

    @asked_by_name
    @abstractmethod
    def run(self, unit: str, part: Part) -> Scan: ...

    def read_pieces(self, unit: str) -> Iterator[Scan]:
        """All points in pieces, where ``run`` gives only some of them (``total`` of its scan is above 0); the pipeline
        takes those near damage from here, twice. Points as ``run`` gives them, without normals."""
        return iter(())

    def read_otherwise(self, unit: str) -> Iterator[Scan]:
        """Other readings of ambiguous files, for example of text without named columns; ``columns`` of each scan says
        which. The pipeline takes one where the scan has not the size of the part."""
        return iter(())
