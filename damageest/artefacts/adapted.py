"""A part that was deformed to follow its scan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from damageest.artefacts.arrays import Floats
from damageest.artefacts.displacement import DisplacementField
from damageest.artefacts.fields import MOST, Checked, Range, require_finite, require_shape
from damageest.artefacts.meshes import Part
from damageest.artefacts.scans import require_rigid


@dataclass(frozen=True, eq=False)
class AdaptedPart(Checked):
    """The part as it was scanned but for its damage: the part as designed, deformed by a smooth field.

    ``part``: the deformed part, of V vertices. ``displacement`` (V,3): that of each vertex from the part as designed;
    over intact skin it has no rigid part. ``motion`` (4,4): rigid; takes the aligned scan onto the deformed part.
    ``modes`` (K,V,3): how exactly the displacement is known: independent errors, each as one standard deviation.
    ``other`` (V,3): what else explains the scan as well, as a change of the displacement; None where nothing does.
    ``amount``, ``rms``: largest and root of the mean square of the displacement over the seen skin. ``growth``: the
    uniform scale in it, less 1; ``strain``: largest principal strain beyond that, without unit; ``lattice``: cells
    along the axes, (0, 0, 0) for a polynomial; ``functions``: how many functions each coordinate is a sum of.
    ``gain``: share by which it explains held-out patches of the scan better than a rigid part. ``field``: the same
    displacement at any place, for CAD faces and for other parts of the type; None where there is none. ``notes`` are
    warnings.
    """

    part: Part
    displacement: Floats
    motion: Floats
    modes: Floats
    amount: float
    rms: float
    growth: float = 0.0
    strain: float = 0.0
    lattice: tuple[int, int, int] = (0, 0, 0)
    functions: int = 0
    gain: float = 0.0
    notes: tuple[str, ...] = ()
    other: Floats | None = None
    field: DisplacementField | None = None
    _dtypes: ClassVar[dict[str, Any]] = {
        "displacement": np.float64,
        "motion": np.float64,
        "modes": np.float64,
        "other": np.float64,
    }
    _ranges: ClassVar[dict[str, Range]] = {
        "amount": (0.0, MOST),
        "rms": (0.0, MOST),
        "strain": (0.0, MOST),
        "growth": (-0.5, 1.0),
        "functions": (0, MOST),
        "gain": (0.0, 1.0),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.part.vertices)
        require_shape("displacement", self.displacement, count, 3)
        require_finite("displacement", self.displacement)
        require_shape("modes", self.modes, "K", count, 3)
        require_finite("modes", self.modes)
        if self.other is not None:
            require_shape("other", self.other, count, 3)
            require_finite("other", self.other)
        require_shape("motion", self.motion, 4, 4)
        require_rigid("motion", self.motion)
