"""What is said of a datum system: what each datum takes, what stays free, and which datum is not to be trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import DatumFit, Floats, FreeMotion, Reason, Vector
from damageest.stages.align.datum._fit import FittedDatum
from damageest.stages.align.datum.system import DatumSystem, Feature
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.wear.words import name_motion, simplify, to_free_motion

REMEDY = "name datums that are not worn in align.datum"
TOLD = 0.1
"""Share of a datum below its shape from which it is told."""
MIN_CONTACT = 0.5
"""Share of a datum on its shape, below which it is open which part of it is the sound one."""

Fits = list[tuple[Feature, FittedDatum, Floats, Floats]]
"""Each datum with its fit, the changes of its radii, and the twists (6,K) that its shape took."""


@dataclass(frozen=True)
class Told:
    datums: tuple[DatumFit, ...]
    notes: tuple[str, ...]
    doubts: tuple[Reason, ...]


def list_motions(frame: Frame, twists: Floats, unit: str) -> tuple[FreeMotion, ...]:
    """Twists (6,F) as shifts and turns of the part's frame, without a range."""
    if not twists.shape[1]:
        return ()
    motions = [to_free_motion(frame, one, 0.0, 0.0, unit) for one in simplify(twists.T)]
    return tuple(FreeMotion(one.direction, 0.0, 0.0, one.point, one.turn, name_motion(one)) for one in motions)


def describe_system(frame: Frame, system: DatumSystem, fits: Fits, free: Floats, tolerance: float, unit: str) -> Told:
    """What was found about each of the datums. ``free`` (6,F): twists that they leave; ``tolerance`` in diagonals."""
    datums, notes, doubts = [], [], []
    for feature, fitted, radii, taken in fits:
        name = f"datum {feature.name} ({feature.kind})"
        datums.append(_summarise(frame, feature, fitted, radii, unit))
        if not taken.shape[1]:
            notes.append(f"{name} has no effect: earlier datums fix its directions already; name another face")
        if fitted.weak.shape[1]:
            named = _join(frame, fitted.weak, unit)
            notes.append(f"{name}: its scanned part does not fix {named}, which counts as free; scan more of it")
        depth = fitted.off * frame.size
        if fitted.contact < MIN_CONTACT:
            text = (
                f"{name}: only {fitted.contact:.0%} of its points lie on one shape where earlier datums allow it: "
                "worn, or misplaced"
            )
            doubts.append(Reason("datum_worn", text, "contradicts", fitted.contact, remedy=REMEDY))
        elif fitted.inside > TOLD:
            notes.append(
                f"{name}: {fitted.inside:.0%} of its points lie up to {depth:.3g} {unit} below its shape and count "
                "as worn; name an unworn face if that is too much"
            )
    if free.shape[1]:
        many = f"{free.shape[1]} degrees" if free.shape[1] > 1 else "1 degree"
        notes.append(
            f"the datums leave {many} of freedom: {_join(frame, free, unit)}; other skin fixes all but symmetries; "
            "name more datums to fix them"
        )
    return Told(tuple(datums), tuple(notes), tuple(doubts))


def _summarise(frame: Frame, feature: Feature, fitted: FittedDatum, radii: Floats, unit: str) -> DatumFit:
    nominal = np.array([one.size * frame.size for one in feature.shapes if one.has_radius])
    return DatumFit(
        name=feature.name,
        kind=feature.kind,
        faces=feature.faces,
        takes=tuple(one.text for one in list_motions(frame, fitted.taken, unit)),
        points=fitted.points,
        contact=min(fitted.contact, 1.0),
        inside=min(fitted.inside, 1.0),
        rms=fitted.rms * frame.size,
        nominal=tuple(float(one) for one in nominal),
        measured=tuple(float(one) for one in nominal + radii * frame.size),
        shapes=tuple(one.kind for one in feature.shapes),
        places=tuple(_to_vector(one.point * frame.size + frame.centre) for one in feature.shapes),
        axes=tuple(_to_vector(one.axis) for one in feature.shapes),
        bores=tuple(one.sign < 0 for one in feature.shapes),
    )


def _to_vector(value: Floats) -> Vector:
    x, y, z = (float(one) + 0.0 for one in value)
    return x, y, z


def _join(frame: Frame, twists: Floats, unit: str) -> str:
    return "; ".join(one.text for one in list_motions(frame, twists, unit))
