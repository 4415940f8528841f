"""One section cut and compared, as its quantities are measured from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.artefacts.sections import SectionContour
from damageest.sections.outlines import WINDOW, FlatScan, Loop
from damageest.sections.planes import Place
from damageest.trust.interval.pose_error import PoseError

FORM_WAVE = 0.03
"""Length of a wave of form, in outlines: form that a fit leaves pulls it as errors do that such a piece shares."""
UNSURE, OF_DISTANCE = 4.0, 0.15
"""Standard error of a station, in medians of all and as a share of its distance, above both of which its distance is no
extreme."""


@dataclass(frozen=True, eq=False)
class Cut:
    """``outlines`` as designed, the longest first, with their ``loops`` of stations and the ``contours`` measured at
    these from the ``flat`` scan. Standard deviations: ``noise`` of points, ``correlated`` of errors that regions of
    ``alike`` across share. ``deviation``: of the part's triangles from its surface. ``seen``: share of the outlines."""

    place: Place
    outlines: list[Floats]
    loops: list[Loop]
    contours: tuple[SectionContour, ...]
    flat: FlatScan
    spacing: float
    tolerance: float
    deviation: float
    noise: float
    correlated: float
    alike: float
    pose: PoseError | None
    seen: float

    @property
    def half(self) -> float:
        """Half the width of the window of a station along an outline."""
        return WINDOW * self.spacing

    def find_leading(self) -> Floats | None:
        """The direction (2,) to the leading edge that the job gives."""
        leading = self.place.choice.leading
        return None if leading is None else np.array([self.place.along, self.place.out]) @ np.array(leading)

    def inflate(self, left: float, form: float) -> float:
        """By how much the variance of a fit to all points grows by errors that neighbours share: those of the sensor,
        and the form that the fit leaves. ``left``, ``form``: standard deviation of the points and of the form about
        the fit."""
        length = self.seen * sum(loop.length for loop in self.loops)
        if not left > 0 or not length > 0:
            return 1.0
        shared = self.correlated**2 * self.alike / length + form**2 * FORM_WAVE
        return 1.0 + len(self.flat.points) * shared / left**2

    def reliable(self, distance: Floats, error: Floats) -> Flags:
        """Which stations (K,) say how far the scan is at most: not those beside a step, which hardly have a
        distance."""
        known = np.isfinite(distance)
        if not known.any():
            return known
        limit = np.maximum(UNSURE * float(np.median(error[known])), OF_DISTANCE * np.abs(distance))
        return np.asarray(known & (error <= np.maximum(limit, 1e-12)))

    def pose_shift(self, flat: Floats, direction: Floats) -> float:
        """Standard deviation, by the pose, of a place (2,) of the plane along a direction (2,)."""
        if self.pose is None or not self.pose.spread.size:
            return 0.0
        basis = np.array([self.place.along, self.place.out])
        place, way = self.place.origin + flat @ basis, direction @ basis
        row = np.concatenate([np.cross(place - self.pose.centre, way), way])
        return float(np.linalg.norm(row @ self.pose.spread))

    def pose_turn(self) -> float:
        """Standard deviation, by the pose, of the turn in the plane, in radians."""
        if self.pose is None or not self.pose.spread.size:
            return 0.0
        return float(np.linalg.norm(self.place.across @ self.pose.spread[:3]))


def sum_errors(error: Floats, correlated: float) -> Floats:
    """Standard deviations (K,) of stations by noise, with that of errors that neighbouring points share."""
    return np.asarray(np.hypot(error, correlated))
