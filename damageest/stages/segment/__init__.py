"""Stage `segment`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from damageest.artefacts import Deviation, Part, Samples, Scan
from damageest.stages import Stage, asked_by_name


class Segment(Stage, ABC):
    """Measures each scan point's signed distance to the part and labels the point (paper 3.1 step 4).

    Args of ``run``, in the part's frame, lengths in the job's unit:
        aligned: the scan, N points, moved into the part's frame; with ``noise`` and ``spacing``.
        part: the part as designed.
        samples: points on all of the part's skin, with normals; no gap is larger than ``samples.spacing``.
        tolerance: distance from the skin up to which a point is intact.

    Returns:
        ``distance`` (N,), positive outside the part; ``face`` (N,) the nearest triangle of the part; ``label`` (N,)
        uint8: DAMAGE deeper inside than the tolerance, ADDED farther outside than the tolerance, else INTACT. An
        implementation may also label shallower points DAMAGE, where many neighbours together show wear. Points in no
        site become OUTLIER only in the result. N may be 0.

    Raises:
        StageError: where the samples are too coarse for the tolerance.

    Example::

        from typing import Literal
        import numpy as np
        from damageest.artefacts import ADDED, DAMAGE, INTACT, Deviation, Part, Scan
        from damageest.geometry.distance import signed_distance
        from damageest.stages.segment import Segment

        class Threshold(Segment):
            "Labels each point by its exact distance alone."
            use: Literal["threshold"] = "threshold"

            def run(self, aligned: Scan, part: Part, tolerance: float) -> Deviation:
                distance, face = signed_distance(aligned.points, part)
                label = np.full(len(distance), INTACT, np.uint8)
                label[distance < -tolerance] = DAMAGE
                label[distance > tolerance] = ADDED
                return Deviation(distance, face, label)
    """

    stage: ClassVar[str] = "segment"
    gives: ClassVar[str] = "deviation"

    @asked_by_name
    @abstractmethod
    def run(self, aligned: Scan, part: Part, samples: Samples, tolerance: float) -> Deviation: ...
