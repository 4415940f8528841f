"""Alignment from picked pairs of points."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator
from pydantic import Field as Option

from damageest.artefacts import Floats, Part, Pose, Scan
from damageest.errors import StageError
from damageest.geometry.transforms import find_nearest_motion, move_points
from damageest.stages.align import Align
from damageest.stages.align.datum.option import NO_DATUM, Datum

Point = tuple[float, float, float]

MAX_RESIDUAL = 0.03
"""Largest distance of a pair's points after the rigid fit of the pairs, in diagonals of the part."""


def _check_pairs(pairs: tuple[tuple[Point, Point], ...]) -> tuple[tuple[Point, Point], ...]:
    points = np.array(pairs)
    if not np.isfinite(points).all():
        raise ValueError("the coordinates must be finite")
    for side, name in enumerate(("in the scan", "on the part")):
        spread = np.linalg.svd(points[:, side] - points[:, side].mean(axis=0), compute_uv=False)
        if spread[1] < 0.02 * spread[0] or not spread[0] > 0:
            raise ValueError(f"the points {name} lie on one line, so that the pose is not determined; pick another one")
    return pairs


class Points(Align):
    """Fits the pose to picked pairs of points, then to the part's triangles like `icp`.

    For scans for which `register` finds no pose, or too many. The pairs need not be exact: an error of a few percent of
    the part's size is corrected by the fit.
    """

    use: Literal["points"] = "points"
    pairs: Annotated[tuple[tuple[Point, Point], ...], AfterValidator(_check_pairs)] = Option(
        min_length=3,
        description="pairs of points, each [[x, y, z] in the scan's frame, [x, y, z] on the part], in the job's unit; "
        "three or more, not on one line",
    )
    iterations: int = Option(60, ge=1, description="largest number of steps of the fit")
    seed: int = Option(
        0, ge=0, description="seed of the random choice of points; the same seed gives the same pose, bit for bit"
    )
    datum: Datum = NO_DATUM

    @property
    def datums(self) -> Datum:
        return self.datum

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """The fitted pose. Raises StageError where the pairs contradict each other, and where the fit from them does
        not converge or does not explain the scan."""
        from damageest.stages.align._fit_start import fit_from_start

        pairs = np.array(self.pairs)
        T, residuals = fit_pairs(pairs)
        if residuals.max() > MAX_RESIDUAL * part.diagonal:
            raise _build_error(pairs, residuals, part)
        reach = max(0.03, 1.5 * float(residuals.max()) / part.diagonal)
        listed = _list_residuals(residuals, part.unit)
        remedy = f"check the picked pairs, which are off by {listed} after their fit; or use align: register"
        return fit_from_start(scan, part, tolerance, T, reach, self.iterations, self.seed, remedy, self.datum)


def fit_pairs(pairs: Floats) -> tuple[Floats, Floats]:
    """The rigid pose (4,4) that takes the first points of pairs (N,2,3) closest to the second ones (Kabsch 1976), and
    the distance (N,) that each pair keeps."""
    T = find_nearest_motion(pairs[:, 0], pairs[:, 1])
    return T, np.linalg.norm(move_points(pairs[:, 0], T) - pairs[:, 1], axis=1)


def _build_error(pairs: Floats, residuals: Floats, part: Part) -> StageError:
    """The error for pairs that contradict each other; it names the one without which the others agree."""
    listed = _list_residuals(residuals, part.unit)
    text = f"the picked pairs contradict each other: after a rigid fit they are off by {listed}"
    if len(pairs) > 3:
        rest = np.array([fit_pairs(np.delete(pairs, k, axis=0))[1].max() for k in range(len(pairs))])
        worst = int(np.argmin(rest))
        if rest[worst] < residuals.max() / 3:
            return StageError(
                f"{text}; without pair {worst + 1} the others agree to {rest[worst]:.3g} {part.unit}",
                f"pick pair {worst + 1} again: its scan point or its point on the part is wrong",
            )
    return StageError(text, "pick them again, and check their order: first the point in the scan, then on the part")


def _list_residuals(residuals: Floats, unit: str) -> str:
    """The residuals as text, by the number of the pair from 1."""
    return ", ".join(f"{value:.3g} {unit} (pair {k})" for k, value in enumerate(residuals, 1))
