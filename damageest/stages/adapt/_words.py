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
        f"the part as designed was deformed by up to {adapted.amount:.3g} {unit} (rms {adapted.rms:.3g}) to follow the "
        f"scan, by {by}, with a strain of at most {100 * adapted.strain:.2g} %; this explains held-out patches better "
        f"by {100 * adapted.gain:.0f} %"
    )
    if abs(adapted.growth) > TOLD:
        words += (
            f"; its scale changed by {100 * adapted.growth:+.2g} %, or that of the scan (scan.scale: auto corrects it)"
        )
        if adapted.growth < 0:
            words += "; wear of that depth all over the part would look like it"
    return words
