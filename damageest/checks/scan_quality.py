"""The tolerance that a scan allows, and what is doubtful about scan and tolerance."""

from __future__ import annotations

from damageest.artefacts import Part, Scan

AUTO_TOLERANCE = 4.0
"""Lambda over the scan's noise where the job says auto: 6 in 100,000 intact points deviate by more."""


def choose_tolerance(wanted: float | None, scan: Scan, part: Part) -> tuple[float, list[str]]:
    """Lambda in the job's unit, and what is doubtful about it, in words. ``wanted`` None: from the scan's noise."""
    least = 1e-4 * part.diagonal
    tolerance = wanted or max(AUTO_TOLERANCE * scan.noise, 2 * part.tessellation_error, least)
    warnings = []
    if tolerance < 3 * scan.noise:
        warnings.append(
            f"the tolerance {tolerance:.3g} is less than three times the scan's noise {scan.noise:.3g}: intact surface "
            f"may be taken for damage; {AUTO_TOLERANCE * scan.noise:.3g} would be safe"
        )
    if part.tessellation_error > tolerance / 2:
        warnings.append(
            f"the part's triangles deviate from the CAD surface by up to {part.tessellation_error:.3g}, more than half "
            f"the tolerance {tolerance:.3g}; ask for a finer chord"
        )
    if scan.spacing > 5 * tolerance:
        warnings.append(
            f"the scan's points lie {scan.spacing:.3g} apart, far more than the tolerance {tolerance:.3g}: the damage "
            "surface between them is interpolated"
        )
    return tolerance, warnings
