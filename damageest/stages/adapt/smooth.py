"""The part as designed, deformed by a smooth field that is as free as the scan bears out."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import AdaptedPart, Floats, Mesh, Part, Scan, fit_displacement
from damageest.errors import StageError
from damageest.geometry.distance import is_inside, signed_distance
from damageest.geometry.neighbourhoods import pick_one_per_cube
from damageest.geometry.refinement import cut_into_cells
from damageest.stages.adapt import Adapt
from damageest.stages.adapt._basis import Basis
from damageest.stages.adapt._choose import Trial, cross_validate, cut_patches, explains_more, is_better
from damageest.stages.adapt._field import STIFF, Body, Field, Freedom, fit, match, weigh
from damageest.stages.adapt._mesh import deform_part, find_motion, refine, require_injective
from damageest.stages.adapt._other import (
    describe_hidden,
    describe_other,
    describe_unknown,
    find_other,
    find_thinned,
    measure_unknown,
)
from damageest.stages.adapt._posterior import find_modes
from damageest.stages.adapt._words import describe

FEWEST = 200
"""Points that a field is fitted to at least."""
FINE = 25.0
"""Edges along the part's diagonal of the triangles that points are matched with."""
PLACES = 500
"""Places in the metal where the strain is asked for."""
ROUNDS, LAST, HELD = 8, 10, 6
"""Rounds from the widest robust scale to the narrowest, more at the narrowest at most, and those of a fit to half of
the patches."""
WIDEST = 12.0
"""Widest robust scale, in tolerances."""
BENT = 0.001
"""Strain beyond that of a bend or a twist, of a field that does nothing else."""
RIGID, SCALED = Freedom(STIFF, grows=False, bends=False), Freedom(STIFF, bends=False)
STRAINED = (0.006, 0.03)
"""Strains beyond that of a bend or a twist that freer fields may have, in the order in which they are tried."""
LOOSEST = 0.1
"""The same where those leave much."""
LOOSE = 0.006
"""Strain from which a lattice is tried too."""
LEFT = 1.15
"""What a polynomial has to leave in half of the patches for it, in mean squares of the noise."""


class Smooth(Adapt):
    """Deforms the part by a smooth field: bend, twist, scale, taper and what a cubic polynomial holds, then a lattice.

    For parts that are bent, twisted, shrunk or made a little differently by more than the tolerance. It is fitted to
    skin on both sides of the part; the strain of the metal is kept small, and a field is only freer where held-out
    patches of the scan, and metal that stands out, are explained better by it. Wear and loss are inward only, and stay.
    """

    use: Literal["smooth"] = "smooth"
    points: int = Option(12_000, ge=1000, le=200_000, description="scan points that the field is fitted to, about")
    lattice: tuple[int, ...] = Option(
        (4,), max_length=4, description="cells of the lattices that are tried, along the longest edge of the box"
    )

    def run(self, part: Part, aligned: Scan, tolerance: float) -> AdaptedPart | None:
        """The adapted part; None where no field explains the scan better than the part as designed. Raises StageError
        for too few points, and where the field would fold the part."""
        centre = part.bounds.mean(axis=0)
        noise = max(aligned.noise, 0.02 * tolerance)
        body = prepare(part, centre, tolerance, noise)
        points = thin(aligned.points, part, self.points, WIDEST * tolerance) - centre
        if len(points) < FEWEST:
            raise StageError(f"only {len(points)} points lie near the part", "scan more of the part, or adapt: none")
        trials, chosen = self._climb(points, body, part.diagonal, tolerance)
        if chosen is trials[0]:
            return None
        return self._finish(part, centre, points, body, trials, chosen, tolerance)

    def _climb(self, points: Floats, body: Body, diagonal: float, tolerance: float) -> tuple[list[Trial], Trial]:
        """The fields that were tried on half of the points, and the one that held-out patches bear out."""
        half, zero = points[::2], Field.zero(body.basis)
        distance = np.abs(match(zero, half, body).distance)
        last = max(tolerance, 3 * body.noise)
        first = float(np.clip(3 * np.quantile(distance, 0.9), last, WIDEST * tolerance))
        scales = [*np.geomspace(first, last, ROUNDS), *[last] * LAST]
        patch, held = cut_patches(half, diagonal)

        def attempt(freedom: Freedom, start: Field, scales: list[float], body: Body = body) -> Trial:
            field = fit(start, half, body, freedom, scales)
            score = cross_validate(field, half, body, freedom, last, HELD, patch, held)
            return Trial(field, freedom, score)

        rigid, scaled = attempt(RIGID, zero, scales), attempt(SCALED, zero, scales)
        # nothing is strained by a scale, and shrinking leaves no metal outside
        chosen = scaled if explains_more(scaled.score.both, rigid.score.both)[0] else rigid
        trials, grows = [rigid, scaled], chosen is scaled

        def take(freedom: Freedom) -> None:
            """Tries a freer field, and takes it where held-out patches bear it out."""
            nonlocal chosen
            trials.append(attempt(freedom, zero, scales))
            chosen = trials[-1] if is_better(trials[-1].score, chosen.score) else chosen

        take(Freedom(BENT, grows=grows))
        if chosen is trials[-1] and not grows:
            take(Freedom(BENT))
            grows = chosen is trials[-1]
        freest = attempt(Freedom(STRAINED[-1], grows, stretches=True), zero, scales)
        if is_better(freest.score, chosen.score):
            for bound in STRAINED:
                take(Freedom(bound, grows))
            chosen = freest if is_better(freest.score, chosen.score) else chosen
        trials.append(freest)
        if np.median(chosen.score.both) > LEFT * body.noise**2:  # as a taper of a thin part, which is of wear's kind
            take(Freedom(LOOSEST, grows))
            take(Freedom(LOOSEST, grows, stretches=True))
        is_rough = np.median(chosen.score.both) > LEFT * body.noise**2
        for cells in self.lattice if is_rough else ():
            finer = replace(body, inside=body.inside[::2], basis=replace(body.basis, cells=cells))
            start = chosen.field.to_basis(finer.basis, np.concatenate([body.inside, body.mesh.vertices]))
            # waves are no polynomial: the best one may be none, and lie far off
            is_near = chosen.freedom.bound >= LOOSE
            freedom = chosen.freedom if is_near else Freedom(STRAINED[-1], grows)
            trials.append(attempt(replace(freedom, cells=cells), start, [last] * ROUNDS if is_near else scales, finer))
            chosen = trials[-1] if is_better(trials[-1].score, chosen.score) else chosen
        if chosen is rigid:
            return trials, chosen
        body = replace(body, basis=chosen.field.basis)
        return trials, replace(chosen, field=fit(chosen.field, points, body, chosen.freedom, [last] * LAST))

    def _finish(
        self, part: Part, centre: Floats, points: Floats, body: Body, trials: list[Trial], chosen: Trial,
        tolerance: float,
    ) -> AdaptedPart:  # fmt: skip
        field, body = chosen.field, replace(body, basis=chosen.field.basis)
        found = match(field, points, body)
        weights = weigh(found, tolerance, body.noise) * (np.abs(found.distance) < 2 * tolerance)
        seen = found.material
        motion = find_motion(seen, field.move(seen), weights)
        turn = motion[:3, :3].T

        def undo(at: Floats) -> Floats:
            return (at - motion[:3, 3]) @ turn.T

        skin = body.mesh.vertices
        require_injective(field, turn, skin, float(np.linalg.norm(undo(field.move(skin)) - skin, axis=1).max()))
        fine, error = refine(part, field, centre, tolerance)
        places = fine.vertices - centre

        moved = undo(field.move(places))
        modes = find_modes(chosen, trials, points, body, Mesh(places, fine.faces), tolerance) @ turn.T
        back = np.eye(4)
        back[:3, :3] = turn
        back[:3, 3] = centre - turn @ (centre + motion[:3, 3])
        length = np.linalg.norm(undo(field.move(seen)) - seen, axis=1)
        intact = weights > 0
        strain = np.linalg.svd(field.differentiate(body.inside), compute_uv=False) / (1 + field.growth) - 1
        _, gain = explains_more(chosen.score.both, trials[0].score.both)
        adapted = AdaptedPart(
            part=deform_part(fine, moved + centre, error),
            displacement=moved - places,
            motion=back,
            modes=modes,
            amount=float(length[intact].max()),
            rms=float(np.sqrt((length[intact] ** 2).mean())),
            growth=field.growth,
            strain=float(np.abs(strain).max()),
            lattice=field.basis.shape_of_cells,
            functions=field.basis.count,
            gain=gain,
            field=fit_displacement(
                lambda at: undo(field.move(at - centre)) - (at - centre),
                part.bounds[0],
                part.bounds[1],
                field.basis.shape_of_cells,
            ),
        )
        rival, is_open = find_other(trials, chosen)
        other = (rival.field.displace(places) - field.displace(places)) @ turn.T if rival and is_open else None
        notes = (describe(adapted, tolerance), *_compare(body, trials, chosen, tolerance, part.unit))
        if (unknown := measure_unknown(modes, adapted.part.vertex_normals)) > tolerance / 2:
            notes = (*notes, describe_unknown(unknown, tolerance, part.unit))
        return replace(adapted, notes=notes, other=other)


def _compare(body: Body, trials: list[Trial], chosen: Trial, tolerance: float, unit: str) -> list[str]:
    """What is said of skin that another field has elsewhere: loss that may be form, and form that may be loss."""
    notes = []
    rival, is_open = find_other(trials, chosen)
    if rival and (thinned := find_thinned(body.mesh, chosen.field, rival.field, tolerance)).area:
        notes.append(describe_other(thinned, is_open, unit))
    if chosen.freedom.bound > BENT:
        stiff = min((one for one in trials if one.freedom.bound <= BENT), key=lambda one: float(one.score.both.mean()))
        if (thinned := find_thinned(body.mesh, stiff.field, chosen.field, tolerance)).area:
            notes.append(describe_hidden(thinned, unit))
    return notes


def prepare(part: Part, centre: Floats, tolerance: float, noise: float) -> Body:
    """What a polynomial field is fitted to the part by, about the centre."""
    extent = np.ptp(part.bounds, axis=0)
    size = float(extent.max()) / 2
    fine, _ = cut_into_cells(Mesh(part.vertices - centre, part.faces), part.diagonal / FINE)
    box = (spread_evenly(40 * PLACES) - 0.5) * extent
    inside = box[is_inside(box, fine)]
    inside = inside[:: max(1, len(inside) // PLACES)]
    inside = inside if len(inside) > PLACES // 10 else fine.triangles.mean(axis=1)[:: max(1, len(fine.faces) // PLACES)]
    return Body(fine, inside, tolerance / 4, noise, Basis(np.zeros(3), size, extent / 2 / size))


def spread_evenly(count: int) -> Floats:
    """(N,3) places in the unit cube whose means, over any box in it, are those of the box: an additive recurrence by
    the root of x^4 = x + 1."""
    root = 1.2207440846057596
    return np.asarray((0.5 + np.arange(1, count + 1)[:, None] * root ** -np.arange(1.0, 4.0)) % 1)


def thin(points: Floats, part: Part, count: int, reach: float) -> Floats:
    """About ``count`` of the points (N,3) that lie within ``reach`` of the part's skin, evenly spread."""
    kept = points[pick_one_per_cube(points, float(np.sqrt(part.area / count)))]
    return kept[np.abs(signed_distance(kept, part)[0]) < reach]
