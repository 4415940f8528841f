"""What is said about an adapted part."""

from __future__ import annotations

from damageest.artefacts import AdaptedPart

TOLD = 2e-5
"""Growth from which it is told."""


def describe(adapted: AdaptedPart, tolerance: float) -> str:
    """How far the part was deformed, by what, and what that leaves open."""
    unit = adapted.part.unit
    by = f"a lattice of {' x '.join(map(str, adapted.lattice))} cells" if any(adapted.lattice) else "a cubic polynomial"
    words = (
        f"the CAD part was deformed by up to {adapted.amount:.3g} {unit} (rms {adapted.rms:.3g}) to follow the scan, "
        "by "
        f"{by}, strain at most {100 * adapted.strain:.2f} %; held-out patches fit better by {100 * adapted.gain:.0f} %"
    )
    if abs(adapted.growth) > TOLD:
        words += (
            f"; part or scan changed scale by {100 * adapted.growth:+.2g} %: measure a length (scan.scale: auto "
            "corrects the scan)"
        )
        if adapted.growth < 0:
            words += "; even wear would look the same"
    return f"{words}; check the rest in the report, coloured by distance"
