"""The tolerance that a scan allows, and what is doubtful about scan and tolerance."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Deviation, Floats, Part, Reason, Scan, Sites
from damageest.errors import InputError, StageError
from damageest.geometry.noise import AUTO_STEPS, AUTO_TOLERANCE, measure_noise_and_spacing, measure_quiet_noise
from damageest.geometry.sampling import sample_by_area

FEW_POINTS = 100
"""Number of points below which a scan shows next to nothing of a part."""

LEAST_TOLERANCE = 1e-6
"""Least tolerance in diagonals of the part; coordinates in single precision, as in STL, have no more digits."""

RAISE = 1.12
"""How many times larger the tolerance has to become before auto raises it after the alignment."""

NEAR_PART = 0.03
"""Distance from the part up to which a point is near it, in diagonals, and at least in twice the tolerance."""

MIN_INTACT = 0.25
"""Least share of the points near the part that must be intact."""

MOST_OUTSIDE = 0.02
"""Share of these points that may lie outside the part where wear explains that few are intact."""

MOST_SPURIOUS = 100
"""Clusters no deeper than the scatter of the points reaches, up to which a scan is gone on with."""

REACH = 4.5
"""Standard deviations up to which scatter alone reaches, in a scan of some 100,000 points."""

ROUNDED = 0.6
"""Least tolerance where an earlier scan stands for the part, in its spacings: its edges are rounded by about a third
of them."""
ALIKE = 0.5
"""Least number of points beyond the tolerance outside, for each of those inside, where scatter puts them there."""


LARGE = 0.005
"""Tolerance in diagonals from which on it may be more than half of each wall of a part."""
ALL_THIN = 0.99
"""Share of the skin with walls thinner than two tolerances from which on a job is refused."""
FAR_BELOW = 2.0
"""Noise over the tolerance from which on a job is refused before the alignment."""
MOST_COMPARED = 100_000
"""Points on the part, at most, that tell how rough it looks by itself."""


def choose_tolerance(wanted: float | None, scan: Scan, part: Part, step: float = 0.0) -> tuple[float, list[Reason]]:
    """Lambda in the job's unit, and what is doubtful about it.

    ``wanted`` None: from the scan's noise and from the ``step`` of its depth (0: continuous). Raises InputError for a
    tolerance that is no length of this part.
    """
    if wanted is not None and not LEAST_TOLERANCE * part.diagonal <= wanted <= part.diagonal:
        low, high = LEAST_TOLERANCE * part.diagonal, part.diagonal
        raise InputError(
            f"tolerance: {wanted:g} {part.unit} does not fit a part that is {part.diagonal:.4g} {part.unit} across; "
            f"give {low:.2g} to {high:.4g}, or auto; check `units`"
        )
    least = 1e-4 * part.diagonal
    noise = float(np.hypot(scan.noise, part.scan_noise))
    auto = max(AUTO_TOLERANCE * noise, AUTO_STEPS * step, 2 * part.tessellation_error, least)
    auto = max(auto, ROUNDED * part.scan_spacing)
    tolerance = wanted or auto
    unit = part.unit
    found: list[Reason] = []
    if step:
        least = AUTO_STEPS * step
        text = (
            f"depth in steps of {step:.3g} {unit}, like that of a depth camera: damage shallower than {least:.3g} "
            f"{unit} is not found"
        )
        remedy = "scan with finer depth if shallower damage matters"
        found.append(Reason("depth_steps", text, amount=least, unit=unit, remedy=remedy))
    if step and tolerance < step:
        text = (
            f"the tolerance {tolerance:.3g} {unit} is below one depth step of the scan: intact surface may look damaged"
        )
        remedy = f"take a tolerance of {AUTO_STEPS * step:.3g} {unit}"
        found.append(Reason("tolerance_small", text, amount=step, unit=unit, remedy=remedy))
    elif tolerance < 3 * scan.noise:
        text = (
            f"the tolerance {tolerance:.3g} {unit} is below three times the noise of {scan.noise:.3g} {unit}: intact "
            "surface may look damaged"
        )
        remedy = f"take a tolerance of {AUTO_TOLERANCE * scan.noise:.3g} {unit}"
        found.append(Reason("tolerance_small", text, amount=scan.noise, unit=unit, remedy=remedy))
    if part.tessellation_error > tolerance / 2:
        text = (
            f"the part's triangles deviate from the CAD surface by up to {part.tessellation_error:.3g} {unit}, more "
            f"than half the tolerance of {tolerance:.3g} {unit}"
        )
        remedy = "set a finer part.chord, or a smaller part.angle if that does not help"
        found.append(Reason("coarse_part", text, amount=part.tessellation_error, unit=unit, remedy=remedy))
    if scan.spacing > 5 * tolerance:
        text = (
            f"sparse scan: points {scan.spacing:.3g} {unit} apart, tolerance {tolerance:.3g} {unit}; the surface "
            "between them is interpolated"
        )
        remedy = "scan more densely, or raise the tolerance"
        found.append(Reason("sparse_scan", text, amount=scan.spacing, unit=unit, remedy=remedy))
    return tolerance, found


def describe_few(scan: Scan) -> list[Reason]:
    """A warning where the scan has next to no points; else nothing."""
    count = len(scan.points)
    if count >= FEW_POINTS:
        return []
    text = f"only {count} scan point{'s' * (count > 1)}: damage between them stays hidden"
    return [Reason("few_points", text, amount=count, remedy="check the file, or scan again")]


def measure_form_deviation(distance: Floats, within: float) -> float:
    """The scale of a standard deviation of the intact points' distances to the part, whatever makes them deviate:
    noise, form errors of scanner or part, an inexact pose.

    Only points outside the part (positive ``distance`` (N,)) are used, because damage is inside. Of these, the ones
    farther than 3.5 deviations are left out, again and again from ``within`` on, until nothing changes. 0 where the
    points are not concentrated at the surface.
    """
    outside = np.sort(distance[(distance > 0) & (distance < within)])
    band = within
    for _ in range(60):
        kept = outside[: np.searchsorted(outside, band)]
        if len(kept) < 30:
            return 0.0
        narrower = 3.5 * 1.4826 * float(np.median(kept))
        if narrower >= 0.999 * band:
            break
        band = narrower
    return band / 3.5 if band < 0.5 * within else 0.0


def raise_tolerance(tolerance: float, distance: Floats, part: Part, noise: float) -> tuple[float, list[Reason]]:
    """Lambda for a scan whose intact points deviate by more than its noise, and a warning that says so; else the same.

    ``tolerance``: chosen from the noise before the alignment. ``distance`` (N,): signed, of the aligned points.
    """
    deviation = measure_form_deviation(distance, NEAR_PART * part.diagonal)
    needed = AUTO_TOLERANCE * deviation
    if needed <= RAISE * tolerance:
        return tolerance, []
    text = (
        f"tolerance raised from {tolerance:.3g} to {needed:.3g} {part.unit}: intact surface deviates by "
        f"{deviation:.3g} {part.unit} (standard deviation), the noise is {noise:.3g} {part.unit}"
    )
    remedy = "check scanner and pose if shallower damage matters"
    return needed, [Reason("tolerance_raised", text, amount=needed, unit=part.unit, remedy=remedy)]


def require_tolerance(tolerance: float, distance: Floats, part: Part, noise: float) -> None:
    """Raises InputError where the points scatter about the part by more than the tolerance, so that damage cannot be
    told from noise.

    ``distance`` (N,): signed, of points in a pose for the ``noise`` as it was measured without one.
    """
    scatter = measure_form_deviation(distance, max(NEAR_PART * part.diagonal, 8 * noise))
    if scatter <= tolerance:
        return
    raise _refuse_tolerance(tolerance, min(scatter, noise), part)


def require_above_noise(tolerance: float, scan: Scan, part: Part) -> None:
    """Raises InputError where the tolerance is so far below the noise that no pose has to be found to say so, as one
    that was measured in another unit.

    Without a pose, noise comes out too large where the skin curves within a few gaps. So the quietest tenth of the scan
    has to scatter by more than the tolerance too, and the part itself must look smooth with a quarter of the points.
    """
    if scan.noise <= FAR_BELOW * tolerance or not scan.spacing > 0 or measure_quiet_noise(scan.points) <= tolerance:
        return
    count = int(min(part.area / (2 * scan.spacing / 1.1) ** 2, MOST_COMPARED))
    points, _ = sample_by_area(part, max(count, 1), np.random.default_rng(0))
    smooth, spacing = measure_noise_and_spacing(points)
    if spacing > 0 and smooth < tolerance / FAR_BELOW:
        raise _refuse_tolerance(tolerance, scan.noise, part, "; is it in another unit than the scan?")


def _refuse_tolerance(tolerance: float, noise: float, part: Part, hint: str = "") -> InputError:
    least, unit = AUTO_TOLERANCE * noise, part.unit
    return InputError(
        f"tolerance: {tolerance:.3g} {unit} is below the noise of the scan, {noise:.2g} {unit}; give at least "
        f"{least:.2g} {unit}, or auto, or a scan with less noise{hint}",
        topic="noise",
    )


def require_real_clusters(sites: Sites, deviation: Deviation, tolerance: float, part: Part) -> None:
    """Raises InputError where scatter about the skin alone makes very many clusters of points labelled as damage.

    Three things have to hold together: the clusters are many, none of these is deeper than the scatter reaches, and
    nearly as many points lie as far outside, where there is no damage. The scatter is that of the points in the pose.
    """
    if sites.count <= MOST_SPURIOUS:
        return
    distance = deviation.distance
    outside, inside = np.count_nonzero(distance > tolerance), np.count_nonzero(distance < -tolerance)
    scatter = measure_form_deviation(distance, NEAR_PART * part.diagonal)
    deepest = np.zeros(sites.count + 1)
    np.maximum.at(deepest, sites.label, -distance)
    spurious = int((deepest[1:] <= REACH * scatter).sum())
    if spurious <= MOST_SPURIOUS or outside < ALIKE * inside:
        return
    unit = part.unit
    deeper = sites.count - spurious
    kept = f"; {deeper} deeper place{'s' * (deeper > 1)} may be damage" if deeper else ""
    raise InputError(
        f"tolerance: {tolerance:.3g} {unit} is too small for points that scatter by {scatter:.2g} {unit}: "
        f"{outside / len(distance):.0%} of them lie farther outside, and {spurious} places are no deeper than the "
        f"scatter{kept}; give at least {AUTO_TOLERANCE * scatter:.2g} {unit}, or auto, or a scan with less noise",
        topic="noise",
    )


def require_intact(distance: Floats, tolerance: float, part: Part) -> None:
    """Raises StageError where few of the points near the part are intact: nothing shows then what is damage.

    ``distance`` (N,): signed, of the aligned points.
    """
    size = np.abs(distance)
    near = np.sort(size[size < max(NEAR_PART * part.diagonal, 2 * tolerance)])
    if len(near) < 50:
        return
    share = float((near <= tolerance).mean())
    if share >= MIN_INTACT:
        return
    better = float(np.quantile(near, 0.75))
    worn = ""
    if float((distance[size <= near[-1]] > tolerance).mean()) < MOST_OUTSIDE:
        worn = (
            f"; nothing lies outside: the part may be worn by about {float(np.median(near)):.2g} {part.unit} all "
            "over, or smaller than its model"
        )
    raise StageError(
        f"only {share:.0%} of the scan points near the part are within the tolerance of {tolerance:.3g} {part.unit}; "
        f"{MIN_INTACT:.0%} are needed to tell damage from errors of scan or pose{worn}",
        f"check the pose first; then a larger tolerance: 75 % of these points lie within {better:.2g} {part.unit}",
        topic="noise",
    )


def check_walls(tolerance: float, part: Part) -> list[Reason]:
    """A warning where the tolerance is so large that damage cannot be found in the part's walls; else nothing."""
    thickness = _measure_walls(part)
    if not len(thickness):
        return []
    thin = float((thickness < 2 * tolerance).mean())
    if thin < 0.1:
        return []
    walls = f"{float(np.quantile(thickness, 0.1)):.3g} {part.unit}"
    text = (
        f"the tolerance {tolerance:.3g} {part.unit} exceeds half the wall thickness on {thin:.0%} of the surface (thin "
        f"walls: {walls}): no damage is found there"
    )
    return [Reason("thin_walls", text, amount=thin, remedy="take a smaller tolerance, with a scan of less noise")]


def require_walls(tolerance: float, part: Part) -> None:
    """Raises InputError where the part has next to no wall that is thick enough for the tolerance: nothing can lie
    deeper than that below its skin, so that nothing can be found."""
    if tolerance < LARGE * part.diagonal:
        return
    thickness = _measure_walls(part)
    if not len(thickness) or float((thickness < 2 * tolerance).mean()) < ALL_THIN:
        return
    unit, most = part.unit, float(np.quantile(thickness, ALL_THIN))
    raise InputError(
        f"tolerance: {tolerance:.3g} {unit} exceeds half the thickness of the part ({most:.3g} {unit} at most): no "
        f"damage can be found; give far less than {most / 2:.2g} {unit}, or auto; check `units`",
        topic="unit",
    )


def _measure_walls(part: Part) -> Floats:
    """The thickness of the part below points on its skin, as far as rays meet it again."""
    from damageest.geometry.rays import measure_thickness

    points, face = sample_by_area(part, 2000, np.random.default_rng(0))
    thickness = measure_thickness(part, points, part.face_normals[face])
    return np.asarray(thickness[np.isfinite(thickness)])
