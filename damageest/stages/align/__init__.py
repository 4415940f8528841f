"""Stage `align`: its contract."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from damageest.artefacts import Floats, Part, Pose, Samples, Scan
from damageest.geometry.selectors import Selector
from damageest.stages import Stage, asked_by_name


class Align(Stage, ABC):
    """Finds the pose of the scan: the rigid motion that takes it into the part's frame (paper 3.1 step 3).

    Args of ``run``, lengths in the job's unit:
        scan: N points (N,3) in the scanner's frame, with their normals or None; ``noise`` and ``spacing`` are measured.
        part: the part as designed. A scan also covers damage, and may cover only some of the skin.
        samples: points on all of the part's skin, with normals.
        tolerance: distance from the skin up to which a point counts as intact.

    Returns:
        ``T_part_scan`` (4,4), a rotation and a translation without scale or mirror: x_part = R x_scan + t. ``rms`` and
        ``inliers`` say how well it fits; ``alternatives`` (K,4,4) lists other poses that fit as well, for example on a
        symmetric part, and ``notes`` describe them. ``free`` and ``is_held`` are optional: motions that unworn skin
        leaves free, and whether that was tested.

    Raises:
        StageError: where no pose explains the scan, or it has too few points.

    Example::

        from typing import Literal
        import numpy as np
        from damageest.artefacts import Part, Pose, Scan
        from damageest.errors import StageError
        from damageest.geometry.distance import distance_to_mesh
        from damageest.stages.align import Align

        class Centre(Align):
            "Moves the middle of the scan to the middle of the part; for scans that are turned the right way already."
            use: Literal["centre"] = "centre"

            def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
                if not len(scan.points) or not np.isfinite(scan.points).all():
                    raise StageError("the scan has no points, or some that are not finite", "give another file")
                T = np.eye(4)
                T[:3, 3] = part.bounds.mean(axis=0) - (scan.points.min(axis=0) + scan.points.max(axis=0)) / 2
                distance = distance_to_mesh(scan.points + T[:3, 3], part)
                near = distance <= tolerance
                rms = float(np.sqrt((distance[near] ** 2).mean())) if near.any() else 0.0
                return Pose(T, rms, float(near.mean()))
    """

    stage: ClassVar[str] = "align"
    gives: ClassVar[str] = "pose"
    gives_fitted_pose: ClassVar[bool] = True
    """Whether the pose is fitted to the scan: then errors of the scan move it, and damage may. False where it is known
    from elsewhere, as from a fixture."""

    @property
    def moves_views(self) -> bool:
        """Whether misplaced views of the scan are corrected after it."""
        return False

    @property
    def known_pose(self) -> Floats | None:
        """(4,4) the pose that is known before the scan is read; None where it is found."""
        return None

    @property
    def datums(self) -> Any:
        """The datums that fix the pose: CAD faces and selectors; by letter, where they are a system. Empty for none."""
        return ()

    def find_selectors(self) -> list[tuple[tuple[str | int, ...], Selector]]:
        """Those of the datums as well, which may name CAD faces without a selector."""
        datum: Any = self.datums
        lists: dict[tuple[str | int, ...], Any] = {("datum",): datum}
        if isinstance(datum, Mapping):  # a system: datums by letter, each a list or a mapping with the list in it
            lists = {
                ("datum", name, "skin") if hasattr(one, "skin") else ("datum", name): getattr(one, "skin", one)
                for name, one in datum.items()
            }
        bare = [
            ((*place, k), Selector(faces=(face,)))
            for place, faces in lists.items() for k, face in enumerate(faces) if isinstance(face, (int, str))
        ]  # fmt: skip
        return [*super().find_selectors(), *bare]

    @asked_by_name
    @abstractmethod
    def run(self, scan: Scan, part: Part, samples: Samples, tolerance: float) -> Pose: ...
