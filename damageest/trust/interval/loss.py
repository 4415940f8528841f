"""A loss whose errors are measured: what its terms have in common, each computed once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from damageest.artefacts import AdaptedPart, Evidence, Flags, Floats, Part, Solid
from damageest.findings import Coverage, Fading
from damageest.geometry.barycentric import find_barycentric
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.lost_depth import LostDepth
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours
from damageest.geometry.scan_field import ScanField
from damageest.trust.beyond_points import BeyondPoints
from damageest.trust.doubt import ScanFacts
from damageest.trust.interval.inner_surface import GAP, InnerSurface, measure_inner_surface
from damageest.trust.interval.pose_error import PoseError
from damageest.trust.interval.scanner import FigureShare, ScannerErrors, find_shares

ASKED = 2000
"""Of the deepest scan points of a site, those beside which its volume is looked at."""
AROUND = 25
"""Scan points about the deepest one, it among them, that tell whether it lies in a corner of the inner surface; by how
many standard deviations of their noise the deepest of many points is deeper than those where it does not; and the share
of what it is deeper by, by which a corner goes beyond it: these points are two gaps away, the deepest about one."""
MOST = 50_000
"""Scan points whose largest depth is taken."""


@dataclass(frozen=True, eq=False)
class Loss:
    """A loss as it was found: its volume ``damage``, which of its faces (F,) are on the ``inner`` surface, as
    `find_inner_faces` gives them, its scan ``points`` (M,3) in the part's frame, what the scan says of the volume, and
    how that lies ``beyond`` its points."""

    damage: Solid
    inner: Flags
    points: Floats
    evidence: Evidence
    beyond: BeyondPoints


@dataclass(frozen=True, eq=False)
class ScanErrors:
    """The errors that all sites of a scan have in common: of the ``pose``, what the ``facts`` say about skin that
    deviates, and what certificate and temperature say of the ``scanner``."""

    pose: PoseError
    facts: ScanFacts
    scanner: ScannerErrors


class Place(NamedTuple):
    """``depth`` of a place ``at`` (3,) below the lost skin, and the outward ``normal`` (3,) of that;
    ``measured``: the largest depth of a scan point; ``rise``: by how much those nearest to it are less deep."""

    depth: float
    measured: float
    rise: float
    at: Floats
    normal: Floats


@dataclass(frozen=True, eq=False)
class LossCase:
    """What a term of the interval is measured on: a ``loss``, the ``field`` of its scan, and the ``errors`` of that.

    ``form``: standard deviation by which the skin deviates systematically, in the job's unit, as a fit of the model
    gives it. ``adapted``: the part as it was deformed, None where it was not. ``coverage``: its unseen regions, None
    where nobody asked; ``fading``: the volumes of a loss that fades out; ``bent_wall``: thickness of a wall that may be
    dented there, else 0.
    """

    loss: Loss
    field: ScanField
    errors: ScanErrors
    form: float = 0.0
    adapted: AdaptedPart | None = None
    coverage: Coverage | None = None
    fading: Fading | None = None
    bent_wall: float = 0.0

    @property
    def tolerance(self) -> float:
        return self.errors.facts.tolerance

    @property
    def skin(self) -> Flags:
        """(F,) the faces of the damage volume on the skin."""
        return ~self.loss.inner

    @cached_property
    def surface(self) -> InnerSurface | None:
        """How its points fix the inner surface; None where none lies on it."""
        loss, aligned = self.loss, self.field.aligned
        return measure_inner_surface(
            loss.damage, loss.inner, loss.points, aligned.noise, aligned.spacing, self.tolerance
        )

    @cached_property
    def skin_area(self) -> float:
        """Area of the skin that is lost."""
        return float(self.loss.damage.face_areas[self.skin].sum())

    @cached_property
    def exposed(self) -> float:
        """Area that what deviates moves against the skin: of a wall that broke off, the root alone."""
        return min(self.skin_area, float(self.loss.damage.face_areas[self.loss.inner].sum()))

    @cached_property
    def places(self) -> tuple[Floats, Floats, Floats]:
        """Centres (S,3), outward normals (S,3) and areas (S,) of the triangles of the lost skin."""
        damage, skin = self.loss.damage, self.skin
        return damage.triangles[skin].mean(axis=1), damage.face_normals[skin], damage.face_areas[skin]

    @property
    def unfollowed(self) -> float:
        """What an adapted part leaves of intact skin: what its field is off by there, the same cause."""
        return self.adapted.unfollowed if self.adapted else 0.0

    @cached_property
    def deviation(self) -> float:
        """Standard deviation of the skin over whole areas, by the largest of what tells it."""
        return max(self.errors.pose.systematic, self.errors.facts.systematic, self.unfollowed)

    @cached_property
    def deepest(self) -> Place:
        """The deepest place of the damage volume."""
        loss = self.loss
        gap = self.surface.gap if self.surface else 0.0
        return _find_deepest(loss.damage, loss.inner, self.field.part, loss.points, 3 * max(gap, self.tolerance))

    @property
    def depth(self) -> float:
        """The largest depth of the damage volume, corrected for its mean error."""
        return self.deepest.depth - (self.surface.depth_excess if self.surface else 0.0)

    @property
    def hole(self) -> float:
        """Area of the largest piece of the inner surface without points, where it counts, else 0."""
        gap = self.loss.evidence.ids_gap
        return gap if gap > GAP * max(self.tolerance, self.field.aligned.spacing) ** 2 else 0.0

    @cached_property
    def bent(self) -> tuple[Floats, float]:
        """What the errors (J,) of an adapted part's field make of the volume, and the standard deviation of the
        distance of the deepest place to the skin. Last, where there is one, what another field that explains the scan
        makes of the volume. The skin that is gone lies elsewhere by them; the volume ends there."""
        adapted = self.adapted
        if adapted is None:
            return np.empty(0), 0.0
        fields = adapted.modes if adapted.other is None else np.concatenate([adapted.modes, adapted.other[None]])
        centres, normals, area = self.places
        deepest = self.deepest
        centres = np.concatenate([centres, deepest.at[None]])
        normals = np.concatenate([normals, deepest.normal[None]])
        moved = measure_shifts(adapted.part, fields, centres, normals)
        return np.asarray(moved[:, :-1] @ area), float(np.linalg.norm(moved[: len(adapted.modes), -1]))

    @cached_property
    def by_figure(self) -> dict[str, FigureShare]:
        """What the figures of the certificate make of volume and depth."""
        loss, deepest = self.loss, self.deepest
        return find_shares(
            self.errors.scanner, loss.damage, loss.inner, (deepest.at, deepest.normal), self.errors.pose,
            self.adapted is not None,
        )  # fmt: skip


def measure_shifts(part: Part, fields: Floats, places: Floats, normals: Floats) -> Floats:
    """How far displacements (J,V,3) of the part's vertices move its skin (J,N) at places (N,3), along normals (N,3)."""
    _, face, at = closest_on_mesh(places, part)
    corners = find_barycentric(part.take_triangles(face), at)
    return np.asarray(np.einsum("nc,jnck,nk->jn", corners, fields[:, part.faces[face]], normals))


def _find_deepest(damage: Solid, inner: Flags, part: Part, members: Floats, reach: float) -> Place:
    """The deepest place of a damage volume. It is near the deepest scan points, so that the other vertices are not
    asked; ``reach``: how near."""
    lost = LostDepth.build(damage, part, inner)
    vertices = damage.vertices[np.unique(damage.faces[inner])]
    # the maximum of a part of many points would be less than what was measured
    asked = members[:: max(1, len(members) // MOST)]
    depths, _ = lost.measure(asked)
    deep = asked[depths > depths.max() - reach]
    near = vertices[find_nearby(vertices, deep[:: max(1, len(deep) // ASKED)], reach)]
    near = near if len(near) else vertices
    depth, normals = lost.measure(near)
    at, first = int(depth.argmax()), int(depths.argmax())
    _, beside = find_neighbours(asked[first : first + 1], min(AROUND, max(7, len(asked) // 4)), asked)
    rise = float(depths[first] - np.median(depths[beside]))
    if lost.through > depth[at]:
        return Place(lost.through, max(lost.through, float(depths[first])), rise, lost.middle, normals[at])
    return Place(float(depth[at]), float(depths[first]), rise, near[at], normals[at])
