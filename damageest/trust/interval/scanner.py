"""What the certificate of a scanner and the temperature of the part do to volumes and depths.

Each figure becomes one systematic error of the whole scan, as one standard deviation: an offset of the surface along
its normal (probing size), a scale (error of length; temperature and expansion), and an error that is common to a region
(probing form). An offset and a scale move the intact skin too, and so the pose, which takes part of them away: how
much, the fit to the intact skin says.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Solid
from damageest.trust.interval.pose_error import PoseError

REFERENCE = 20.0
"""Temperature in °C at which the dimensions of a drawing hold (ISO 1)."""
FORM_RANGE = 4.0
"""Standard deviations that a probing form error comprises: it is the range of at least 95 % of the points."""
Distribution = Literal["normal", "rectangular"]
Kind = Literal["offset", "scale"]
TERMS: dict[str, Kind] = {
    "probing_size": "offset", "length": "scale", "temperature": "scale", "expansion": "scale", "fitted_scale": "scale"
}  # fmt: skip
"""The errors that all of the scan has in common, and what they do to it. ``fitted_scale``: of a scan whose scale was
fitted to the part, in place of the others."""


@dataclass(frozen=True)
class Figure:
    """One systematic error of the scan. ``uncertainty``: standard uncertainty of the figure, in ``unit``; ``rate``: the
    offset (in the job's unit) or the scale (as a share) for each unit of it."""

    name: str
    uncertainty: float
    unit: str
    rate: float
    distribution: Distribution

    @property
    def effect(self) -> float:
        """The standard uncertainty of the offset or of the scale."""
        return self.uncertainty * abs(self.rate)


@dataclass(frozen=True)
class ScannerErrors:
    """``terms``: of `TERMS`, those that the job tells. ``form``: standard uncertainty by the probing form error beyond
    what the scan itself shows. ``unknown``: what the job does not tell. ``certificate``: scanner and standard in
    words."""

    terms: tuple[Figure, ...] = ()
    form: float = 0.0
    unknown: tuple[str, ...] = ()
    certificate: str = ""

    @property
    def scale(self) -> float:
        """Standard uncertainty of the scale of the scan, as a share."""
        return self._sum("scale")

    @property
    def offset(self) -> float:
        """Standard uncertainty of the offset of the surface, in the job's unit."""
        return self._sum("offset")

    def _sum(self, kind: Kind) -> float:
        return float(np.sqrt(sum(one.effect**2 for one in self.terms if TERMS[one.name] == kind)))


class FigureShare(NamedTuple):
    """By how much a volume and its largest depth change with a ``figure``, for one standard uncertainty."""

    figure: Figure
    volume: float
    depth: float


def find_shares(
    errors: ScannerErrors, damage: Solid, inner: Flags, deepest: tuple[Floats, Floats], pose: PoseError, follows: bool
) -> dict[str, FigureShare]:
    """What the terms make of a site, by their names.

    Args:
        inner: (F,) which faces of ``damage`` are on its inner surface.
        deepest: its deepest place (3,), and the outward normal (3,) of the skin there.
        follows: whether the part was adapted to the scan: then the skin that is gone has the same errors.

    An offset d of the surface toward the outside makes the volume smaller by d times the inner area; a scale s about a
    centre c moves the inner surface by s (x - c). What the fit of the pose answers is undone.
    """
    area = damage.face_areas
    centres, normals = damage.triangles.mean(axis=1) - pose.centre, damage.face_normals
    flux = np.einsum("ij,ij->i", centres, normals) * area
    place, outward = deepest[0] - pose.centre, deepest[1]
    if follows:
        # the volume as a whole is scaled, and a shell of the offset's width moves from its inner to its outer side
        volume = {"offset": float(area[~inner].sum() - area[inner].sum()), "scale": float(flux.sum())}
        depth = {"offset": 0.0, "scale": 0.0}
    else:
        undone = {"offset": pose.by_offset, "scale": pose.by_scale}
        skin = (damage.triangles[~inner].mean(axis=1), normals[~inner], area[~inner])
        direct = {"offset": -float(area[inner].sum()), "scale": float(flux[inner].sum())}
        volume = {kind: direct[kind] - pose.of_motion(motion, *skin) for kind, motion in undone.items()}
        moved = {"offset": -1.0, "scale": -float(place @ outward)}
        depth = {kind: moved[kind] + pose.move_distance(motion, deepest[0], outward) for kind, motion in undone.items()}
    found = {}
    for one in errors.terms:
        kind, size = TERMS[one.name], one.uncertainty * one.rate
        found[one.name] = FigureShare(one, volume[kind] * size, depth[kind] * size)
    return found


def spread_of(value: float, k: float | None) -> tuple[float, Distribution]:
    """Standard uncertainty of a figure of a certificate: an expanded uncertainty with the coverage factor ``k``, or,
    without one, a limit (half the width of a rectangular distribution)."""
    return (value / 3**0.5, "rectangular") if k is None else (value / k, "normal")


def leave_form(probing_form: float, noise: float, systematic: float) -> float:
    """Standard uncertainty that a probing form error leaves beyond the errors that the scan shows itself, which are
    counted elsewhere."""
    return float(np.sqrt(max((probing_form / FORM_RANGE) ** 2 - noise**2 - systematic**2, 0.0)))
