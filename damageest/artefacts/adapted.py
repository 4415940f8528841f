"""A part that was deformed to follow its scan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from damageest.artefacts.arrays import Floats
from damageest.artefacts.displacement import DisplacementField
from damageest.artefacts.fields import MOST, Checked, Range, require_finite, require_shape
from damageest.artefacts.meshes import Part
from damageest.artefacts.poses import require_rigid


@dataclass(frozen=True)
class PriorUse(Checked):
    """Prediction by other parts of the type; ``misfit`` is along the normals."""

    parts: int
    misfit: Annotated[float, "root mean square residual of their forms on seen skin"]
    limit: Annotated[float, "largest misfit of a part of the type"]
    is_used: Annotated[bool, "whether they predicted lost skin; false: this part deforms in another way"]
    _ranges: ClassVar[dict[str, Range]] = {"parts": (1, MOST), "misfit": (0.0, MOST), "limit": (0.0, MOST)}


@dataclass(frozen=True, eq=False)
class AdaptedPart(Checked):
    """The scanned part without its damage: the part as designed, deformed by a smooth field.

    ``part``: the deformed part, of V vertices. ``displacement`` (V,3): that of each vertex from the part as designed;
    over intact skin it has no rigid part. ``motion`` (4,4): rigid; takes the aligned scan onto the deformed part.
    ``modes`` (K,V,3): independent errors of the displacement where no intact skin shows it, each as one standard
    deviation; ``unfollowed``: the same beside intact skin, from the worst residuals of the field. ``lowered`` (V,):
    depth of the skin below that of a field that hardly strains the metal, where noted: form or wear. ``other`` (V,3):
    change of the displacement that explains the scan as well; None where there is none. ``held_out``: root mean square
    residuals of rigid part and field in held-out patches, deviations limited; ``patches``: their number. ``field``: the
    same displacement at any place, for CAD faces and for other parts of the type; None where there is none. ``seen``
    (S,3): places on the skin as designed where intact skin was scanned; skin within ``reach`` of one was seen; ``left``
    (S,): distance of the scan outside the adapted skin there, noise averaged out. ``designed``: hashes that name the
    part as designed, for jobs on other parts of its type. ``notes`` are warnings.
    """

    part: Part
    displacement: Floats
    motion: Annotated[Floats, "4x4, the rigid motion beside the deformation, contained in alignment.transform"]
    modes: Floats
    amount: Annotated[float, "largest displacement of the seen intact skin, without a rigid motion"]
    rms: Annotated[float, "root mean square displacement of the same skin"]
    growth: Annotated[float, "uniform scale of the displacement, less 1"] = 0.0
    strain: Annotated[float, "largest strain of the metal beyond uniform scale, without unit"] = 0.0
    lattice: Annotated[tuple[int, int, int], "cells along the axes; 0, 0, 0: a cubic polynomial"] = (0, 0, 0)
    functions: Annotated[int, "number of smooth functions for each coordinate of the displacement"] = 0
    gain: Annotated[float, "relative gain in the fit of held-out patches, against a rigid part"] = 0.0
    notes: tuple[str, ...] = ()
    other: Floats | None = None
    field: DisplacementField | None = None
    hidden: float = 0.0
    held_out: tuple[float, float] = (0.0, 0.0)
    patches: int = 0
    seen: Floats | None = None
    reach: float = 0.0
    left: Floats | None = None
    prior: Annotated[PriorUse | None, "null where no other parts of the type were given"] = None
    designed: tuple[str, ...] = ()
    unfollowed: float = 0.0
    lowered: Floats | None = None
    _dtypes: ClassVar[dict[str, Any]] = {
        "displacement": np.float64,
        "motion": np.float64,
        "modes": np.float64,
        "other": np.float64,
        "seen": np.float64,
        "left": np.float64,
        "lowered": np.float64,
    }
    _ranges: ClassVar[dict[str, Range]] = {
        "amount": (0.0, MOST),
        "rms": (0.0, MOST),
        "strain": (0.0, MOST),
        "growth": (-0.5, 1.0),
        "functions": (0, MOST),
        "gain": (0.0, 1.0),
        "hidden": (0.0, MOST),
        "held_out": (0.0, MOST),
        "patches": (0, MOST),
        "reach": (0.0, MOST),
        "unfollowed": (0.0, MOST),
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
        if self.seen is not None:
            require_shape("seen", self.seen, "S", 3)
            require_finite("seen", self.seen)
        if self.left is not None:
            require_shape("left", self.left, 0 if self.seen is None else len(self.seen))
            require_finite("left", self.left)
        if self.lowered is not None:
            require_shape("lowered", self.lowered, count)
            require_finite("lowered", self.lowered)
        require_shape("motion", self.motion, 4, 4)
        require_rigid("motion", self.motion)
