"""The part as designed, deformed by a smooth field that is as free as the scan bears out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal, Self

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import AdaptedPart, Floats, Mesh, Part, Scan, fit_displacement
from damageest.errors import InputError, StageError
from damageest.geometry.transforms import find_nearest_motion, move_points
from damageest.io.forms import identify_part
from damageest.stages import JobPaths
from damageest.stages.adapt import Adapt
from damageest.stages.adapt._body import prepare, thin
from damageest.stages.adapt._choose import SHARE, Score, Trial
from damageest.stages.adapt._climb import BENT, RIGID, WIDEST, Climbed, choose_scales, climb, score
from damageest.stages.adapt._field import Body, Field, match, weigh
from damageest.stages.adapt._fit import fit
from damageest.stages.adapt._mesh import deform_part, refine, require_injective
from damageest.stages.adapt._other import (
    TOLD,
    describe_hidden,
    describe_other,
    describe_unknown,
    find_other,
    find_thinned,
    measure_unknown,
)
from damageest.stages.adapt._posterior import find_modes, find_spacing, measure_left
from damageest.stages.adapt._prior import Start, describe_prior, read_prior, start_from
from damageest.stages.adapt._words import describe

FEWEST = 200
"""Points that a field is fitted to at least."""
AVERAGED = 16
"""Neighbours whose deviations are averaged, so that noise is not taken for form."""
STRAINS = {"metal": 0.003, "casting": 0.01, "sheet": 0.03, "polymer": 0.1}
"""Strain that metal keeps when it was bent, about its yield strain or a little more, and that of parts whose form is as
they came out of the mould or the press."""
SEEN = 4000
"""Places that tell which skin was seen, about."""


class Smooth(Adapt):
    """Deforms the part by a smooth field: bend, twist, scale, taper and other cubic polynomials, then a lattice.

    For parts that are bent, twisted, shrunk or made a little differently by more than the tolerance. The fit uses skin
    on both sides of the part and keeps the strain of the metal small. A freer field has to explain held-out patches of
    the scan, and metal outside the part, better. Wear and loss are inward only, and stay.
    """

    use: Literal["smooth"] = "smooth"
    points: int = Option(12_000, ge=1000, le=200_000, description="number of scan points used for the fit, about")
    lattice: tuple[int, ...] = Option(
        (4,), max_length=4, description="cells of the lattices tried, along the longest edge of the box"
    )

    process: Literal["metal", "casting", "sheet", "polymer"] = Option(
        "metal",
        description="how the part was made: limits strain beyond bend and twist to 0.3 % for metal, 1 % for a casting, "
        "3 % for sheet, 10 % for a polymer, unless more explains the skin down to the noise",
    )
    prior: JobPaths = Option(
        (),
        max_length=500,
        description="files adapt.npz of other parts of the type, by which skin that is lost is predicted, or a glob of "
        "them; default: none",
    )

    def leave_out(self, folder: Path) -> Self:
        """Without the form that an earlier run of the same job wrote: a part is no evidence for itself."""
        others = tuple(path for path in self.prior if path.parent != folder)
        if self.prior and not others:
            raise InputError(
                f"adapt.prior: names only {self.prior[0]}, which this run overwrites; give the files of other "
                "parts of the type"
            )
        return self.model_copy(update={"prior": others}) if len(others) < len(self.prior) else self

    def run(self, part: Part, aligned: Scan, tolerance: float) -> AdaptedPart | None:
        """The adapted part; None where no field explains the scan better than the part as designed. Raises StageError
        for too few points, and where the field would fold the part; InputError for a prior of another part."""
        forms = read_prior(self.prior, part, aligned) if self.prior else []
        centre = part.bounds.mean(axis=0)
        noise = max(aligned.noise, 0.02 * tolerance)
        body = prepare(part, centre, tolerance, noise)
        points = thin(aligned.points, part, self.points, WIDEST * tolerance) - centre
        if len(points) < FEWEST:
            raise StageError(f"only {len(points)} points lie near the part", "scan more of the part, or adapt: none")
        start = None
        if forms:
            start = start_from(forms, part, points, body, choose_scales(points, body, tolerance), tolerance)
        if start and start.used.is_used and (adapted := self._go_on(start, part, centre, points, body, tolerance)):
            return adapted
        climbed = climb(points, body, part.diagonal, tolerance, self.lattice, STRAINS[self.process])
        if climbed.chosen is climbed.trials[0]:
            return None
        adapted = self._finish(part, centre, points, body, climbed, tolerance)
        if start is None:
            return adapted
        unused = replace(start, used=replace(start.used, is_used=False))
        return replace(adapted, prior=unused.used, notes=(*adapted.notes, describe_prior(unused, tolerance, part.unit)))

    def _go_on(
        self, start: Start, part: Part, centre: Floats, points: Floats, body: Body, tolerance: float
    ) -> AdaptedPart | None:
        """The part from the form that others of its type predict, and a field that holds what the scan shows beside;
        None where the part as designed explains the scan as well."""
        fine, _ = refine(part, centre, tolerance, start.field)
        shape = replace(fine, vertices=start.field.move(fine.vertices - centre) + centre)
        own, moved = prepare(shape, centre, tolerance, body.noise), move_points(points, start.motion)
        held = start.find_held(len(points))
        strain = STRAINS[self.process]
        climbed = climb(np.concatenate([moved, held]), own, part.diagonal, tolerance, self.lattice, strain)
        # the points that hold the field where no skin is left are no part of the scan
        after = score(climbed.chosen.field, climbed.chosen.freedom, moved, own, part.diagonal, tolerance)
        rigid = fit(Field.zero(body.basis), points[::2], body, RIGID, choose_scales(points, body, tolerance))
        before = score(rigid, RIGID, points, body, part.diagonal, tolerance)
        if after.both.mean() > (1 - SHARE) * before.both.mean():
            return None
        return self._finish(part, centre, moved, own, climbed, tolerance, start, (before, after))

    def _finish(
        self, part: Part, centre: Floats, points: Floats, body: Body, climbed: Climbed, tolerance: float,
        start: Start | None = None, scores: tuple[Score, Score] | None = None,
    ) -> AdaptedPart:  # fmt: skip
        """The adapted part: of the chosen field, after the ``start`` that other parts gave, where there is one; the
        ``scores`` are then those of the part as designed and of both."""
        trials, chosen = climbed
        field, body = chosen.field, replace(body, basis=chosen.field.basis)
        before, after = scores or (trials[0].score, chosen.score)
        found = match(field, points, body)
        weights = weigh(found, tolerance, body.noise) * (np.abs(found.distance) < 2 * tolerance)
        seen = start.field.undo(found.material) if start else found.material
        motion = find_nearest_motion(seen, field.move(found.material), weights)
        turn = motion[:3, :3].T

        def begin(at: Floats) -> Floats:
            return start.field.move(at) if start else at

        def undo(at: Floats) -> Floats:
            return (at - motion[:3, 3]) @ turn.T

        skin = begin(body.mesh.vertices)
        require_injective(field, turn, skin, float(np.linalg.norm(undo(field.move(skin)) - skin, axis=1).max()))
        if start:
            first = body.mesh.vertices
            require_injective(start.field, np.eye(3), first, float(np.linalg.norm(skin - first, axis=1).max()))
        fine, error = refine(part, centre, tolerance, *([start.field] if start else []), field)
        places = fine.vertices - centre
        begun = begin(places)
        moved = undo(field.move(begun))
        intact = weights > 0
        beyond, shown = None, points
        if start:
            at = seen[np.abs(found.distance) < tolerance]
            own = None if chosen.freedom == RIGID else field.displace(begun)
            left = average(found.material[intact], found.distance[intact], found.material[intact][::8])
            off = float(np.sqrt((left**2).mean())) * Mesh(begun, fine.faces).vertex_normals
            beyond = start.go_beyond(places, at, find_spacing(body, points), own, off)
            # how far the others miss an end is in `beyond`: the field that is fitted beside is held there
            shown = np.concatenate([points, start.find_held(len(points))])
        modes = find_modes(chosen, trials, shown, body, Mesh(begun, fine.faces), tolerance, beyond) @ turn.T
        back = np.eye(4)
        back[:3, :3] = turn
        back[:3, 3] = centre - turn @ (centre + motion[:3, 3])
        length = np.linalg.norm(undo(field.move(found.material)) - seen, axis=1)
        told = np.flatnonzero(intact)[:: max(1, int(intact.sum()) // SEEN)]
        gradient = field.differentiate(body.inside)
        growth = field.growth
        if start:
            gradient = gradient @ start.field.differentiate(start.field.undo(body.inside))
            growth = float(np.cbrt(np.median(np.linalg.det(gradient)))) - 1
            back = back @ about(start.motion, centre)
        strain = np.linalg.svd(gradient, compute_uv=False) / (1 + growth) - 1
        adapted = AdaptedPart(
            part=deform_part(fine, moved + centre, error),
            displacement=moved - places,
            motion=back,
            modes=modes,
            amount=float(length[intact].max()),
            rms=float(np.sqrt((length[intact] ** 2).mean())),
            growth=growth,
            strain=float(np.abs(strain).max()),
            lattice=field.basis.shape_of_cells,
            functions=field.basis.count,
            gain=max(1 - float(after.both.mean() / max(before.both.mean(), 1e-300)), 0.0),
            field=fit_displacement(
                lambda at: undo(field.move(begin(at - centre))) - (at - centre),
                part.bounds[0],
                part.bounds[1],
                np.maximum(field.basis.shape_of_cells, start.field.basis.shape_of_cells if start else 0).tolist(),
            ),
            held_out=(float(np.sqrt(before.both.mean())), float(np.sqrt(after.both.mean()))),
            patches=len(after.both),
            seen=seen[told] + centre,
            left=average(found.material[intact], found.distance[intact], found.material[told]),
            reach=find_spacing(body, points[:SEEN]),
            prior=start.used if start else None,
            designed=identify_part(part),
            unfollowed=measure_left(found, weigh(found, max(tolerance, 3 * body.noise), body.noise), body),
        )
        rival, is_open = find_other(trials, chosen, body.noise)
        other = (rival.field.displace(begun) - field.displace(begun)) @ turn.T if rival and is_open else None
        compared, hidden = _compare(body, trials, chosen, rival, is_open, tolerance, part.unit)
        lowered = None
        if hidden and (stiff := find_stiff(trials)) is not None:
            more = stiff.field.displace(begun) - field.displace(begun)
            depth = np.einsum("ij,ij->i", more, Mesh(begun, fine.faces).vertex_normals)
            lowered = np.where(depth > TOLD * tolerance, depth, 0.0)
        notes = (describe(adapted, tolerance), *compared)
        if start:
            notes = (*notes, describe_prior(start, tolerance, part.unit))
        if (unknown := measure_unknown(modes, adapted.part.vertex_normals)) > tolerance / 2:
            notes = (*notes, describe_unknown(unknown, tolerance, part.unit))
        return replace(adapted, notes=notes, other=other, hidden=hidden, lowered=lowered)


def _compare(
    body: Body, trials: list[Trial], chosen: Trial, rival: Trial | None, is_open: bool, tolerance: float, unit: str
) -> tuple[list[str], float]:  # fmt: skip
    """What is said of skin that another field has elsewhere: loss that may be form, and form that may be loss; and the
    volume of the latter."""
    notes, hidden = [], 0.0
    if rival and (thinned := find_thinned(body.mesh, chosen.field, rival.field, tolerance)).area:
        notes.append(describe_other(thinned, is_open, unit))
    if chosen.freedom.bound > BENT:
        stiff = find_stiff(trials)
        if stiff is not None and (thinned := find_thinned(body.mesh, stiff.field, chosen.field, tolerance)).area:
            notes.append(describe_hidden(thinned, unit))
            hidden = thinned.volume
    return notes, hidden


def find_stiff(trials: list[Trial]) -> Trial | None:
    """The best of the fields that strain the metal no more than a bend or a twist does."""
    stiff = [one for one in trials if one.freedom.bound <= BENT]
    return min(stiff, key=lambda one: float(one.score.both.mean())) if stiff else None


def average(places: Floats, values: Floats, asked: Floats) -> Floats:
    """(M,) the means of values (N,) at the nearest of their places (N,3) to those asked for (M,3)."""
    from scipy.spatial import cKDTree

    return np.asarray(
        values[cKDTree(places).query(asked, min(AVERAGED, len(places)))[1]].reshape(len(asked), -1).mean(axis=1)
    )


def about(T: Floats, centre: Floats) -> Floats:
    """A motion (4,4) about the centre (3,) as one about the origin."""
    shift = np.eye(4)
    shift[:3, 3] = centre
    return np.asarray(shift @ T @ np.linalg.inv(shift))
