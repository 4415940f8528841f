"""Stage `adapt`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import AdaptedPart, Part, Scan
from damageest.stages import Stage, asked_by_name


class Adapt(Stage, ABC):
    """Deforms the part as designed until it follows the intact skin of the scan. All later stages work on the result.

    An implementation that never deforms sets ``deforms`` to False; it is not called. One with ``asks_first`` is called
    only where the intact skin shows that the part as designed does not explain the scan.

    Args of ``run``, lengths in the job's unit:
        part: the part as designed.
        aligned: N points (N,3) in the part's frame, with ``noise`` and ``spacing``. A scan also covers damage, and may
            cover only some of the skin.
        tolerance: distance from the skin up to which a point counts as intact.

    Returns:
        None where the part as designed explains the scan: everything goes on as without this stage. Else the adapted
        part: the skin of ``part``, with a displacement that is 0 on average over intact skin and does not turn it, and
        the rigid ``motion`` that takes the aligned scan onto it. ``part`` keeps unit, path and CAD faces; these follow
        where there is a ``field``. Neither wear nor damage nor added metal may be followed.

    Raises:
        StageError: where the deformed part would not be a solid, or the scan has too few points.

    Example::

        from typing import Literal
        import numpy as np
        from dataclasses import replace
        from damageest.artefacts import AdaptedPart, Part, Scan
        from damageest.stages.adapt import Adapt

        class Grow(Adapt):
            "Makes the part larger by a known share, as after a coating."
            use: Literal["grow"] = "grow"
            percent: float = 0.1

            def run(self, part: Part, aligned: Scan) -> AdaptedPart | None:
                if not len(aligned.points) or not self.percent:
                    return None
                centre = part.bounds.mean(axis=0)
                moved = self.percent / 100 * (part.vertices - centre)
                length = np.linalg.norm(moved, axis=1)
                return AdaptedPart(
                    replace(part, vertices=part.vertices + moved), moved, np.eye(4), np.zeros((0, *moved.shape)),
                    float(length.max()), float(np.sqrt((length**2).mean())), self.percent / 100,
                )
    """

    stage: ClassVar[str] = "adapt"
    gives: ClassVar[str] = "adapted"
    deforms: ClassVar[bool] = True
    asks_first: ClassVar[bool] = False

    @asked_by_name
    @abstractmethod
    def run(self, part: Part, aligned: Scan, tolerance: float) -> AdaptedPart | None: ...
