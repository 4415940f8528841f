"""A part that was deformed to follow its scan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from damageest.artefacts.arrays import Floats
from damageest.artefacts.displacement import DisplacementField
from damageest.artefacts.fields import Checked, Count, NotNegative, Shape, Share, Span, require_shape
from damageest.artefacts.meshes import Part
from damageest.artefacts.poses import require_rigid


@dataclass(frozen=True)
class PriorUse(Checked):
    """Prediction by other parts of the type; ``misfit`` is along the normals."""

    parts: Annotated[int, Span(1)]
    misfit: Annotated[NotNegative, "root mean square residual of their forms on seen skin"]
    limit: Annotated[NotNegative, "largest misfit of a part of the type"]
    is_used: Annotated[bool, "whether they predicted lost skin; false: this part deforms in another way"]


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
    displacement: Annotated[Floats, Shape("V", 3)]
    motion: Annotated[
        Floats, Shape(4, 4), "4x4, the rigid motion beside the deformation, contained in alignment.transform"
    ]
    modes: Annotated[Floats, Shape("K", "V", 3)]
    amount: Annotated[NotNegative, "largest displacement of the seen intact skin, without a rigid motion"]
    rms: Annotated[NotNegative, "root mean square displacement of the same skin"]
    growth: Annotated[float, Span(-0.5, 1.0), "uniform scale of the displacement, less 1"] = 0.0
    strain: Annotated[NotNegative, "largest strain of the metal beyond uniform scale, without unit"] = 0.0
    lattice: Annotated[tuple[int, int, int], "cells along the axes; 0, 0, 0: a cubic polynomial"] = (0, 0, 0)
    functions: Annotated[Count, "number of smooth functions for each coordinate of the displacement"] = 0
    gain: Annotated[Share, "relative gain in the fit of held-out patches, against a rigid part"] = 0.0
    notes: tuple[str, ...] = ()
    other: Annotated[Floats | None, Shape("V", 3)] = None
    field: DisplacementField | None = None
    hidden: NotNegative = 0.0
    held_out: Annotated[tuple[float, float], Span(0.0)] = (0.0, 0.0)
    patches: Count = 0
    seen: Annotated[Floats | None, Shape("S", 3)] = None
    reach: NotNegative = 0.0
    left: Annotated[Floats | None, Shape("S")] = None
    prior: Annotated[PriorUse | None, "null where no other parts of the type were given"] = None
    designed: tuple[str, ...] = ()
    unfollowed: NotNegative = 0.0
    lowered: Annotated[Floats | None, Shape("V")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require_shape("displacement", self.displacement, len(self.part.vertices), 3)
        if self.left is not None and self.seen is None:
            require_shape("left", self.left, 0)
        require_rigid("motion", self.motion)
