"""What result.json says of a part that was deformed to follow its scan."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import AdaptedPart
from damageest.output.base import JsonModel


class AdaptReport(JsonModel):
    """How the part as designed was deformed. Sites, damage and coordinates are those of the deformed part."""

    amount: float = Field(description="largest displacement of the seen intact skin, without a rigid motion")
    rms: float = Field(description="root of the mean square of the same")
    growth: float = Field(description="uniform scale in it, less 1")
    strain: float = Field(description="largest strain of the metal beyond that, without unit")
    lattice: tuple[int, int, int] = Field(description="cells along the axes; 0, 0, 0: a cubic polynomial")
    functions: int = Field(description="how many smooth functions each coordinate of the displacement is a sum of")
    gain: float = Field(description="share by which it explains held-out patches of the scan better than a rigid part")
    motion: list[list[float]] = Field(
        description="4x4, the rigid motion beside it, which is in alignment.transform too"
    )


def report_adapt(adapted: AdaptedPart | None) -> AdaptReport | None:
    """The deformation as values for JSON."""
    if adapted is None:
        return None
    names = ("amount", "rms", "growth", "strain", "lattice", "functions", "gain")
    return AdaptReport(**{name: getattr(adapted, name) for name in names}, motion=adapted.motion.tolist())
