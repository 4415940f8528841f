"""How well the part as designed, in one rigid pose, explains the intact skin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Part
from damageest.findings import Deformed, ModelFit, PatchDeviation
from damageest.geometry.patches import Patches
from damageest.geometry.transforms import remove_rigid
from damageest.trust.form.form_choice import FormChoice, choose_form
from damageest.trust.form.form_fields import Field
from damageest.trust.form.form_fit import Form
from damageest.trust.form.form_words import describe_fit
from damageest.trust.views.view_fit import ViewFits

SIZES = (20.0, 50.0, 100.0)
"""Widths of patches of skin, in tolerances."""
FEWEST_PATCHES, FEWEST_POINTS = 12, 6
"""Patches of a width, for it to be told, and points in a patch."""
LEAST_AMOUNT = 0.15
"""Displacement of the skin, in tolerances, below which a form does not matter."""
LARGEST_AMOUNT, LARGEST_SCALE = 15.0, 0.04
"""Displacement of the skin in tolerances, and relative change of length, beyond which a form is not believed: a face of
a fracture was mistaken for skin."""
CERTAIN = 5.0
"""How many standard errors the amount of a form has to be above zero."""
OUTSIDE = 0.2
"""How much skin that lies outside a form has to explain, compared with skin inside that it explains: wear and loss put
none outside."""
OUTSIDE_IF_SURE, SURE = 0.03, 30.0
"""The same for a form of one bend or twist that is this many standard errors away from none: of a twisted shaft, only
the flanks of its key come to lie outside."""
LEAST_EXPLAINED = 0.3
"""Share of the skin that deviates by up to 1.5 times the amount which a form has to explain; the rest is wear."""
ALIKE = 0.3
"""Relative difference of the scales by axis up to which they are one scale."""
OWN_SHARE = 0.3
"""Share of the amount from which a kind of deformation is named beside others."""
INTACT = 1.5
"""Distance from the skin, in tolerances, up to which points count as intact after the form is undone."""
PLAIN = 5.0
"""How many times larger than the waviness that it leaves a form has to be, to be named before the waviness."""
WAVY = 0.3
"""Waviness, in tolerances, from which the skin is wavy."""
_GROUPS: dict[str, Deformed] = {
    "scale": "scale", "stretch": "stretch", "shear": "shear", "bend": "bend", "lean": "bend", "twist": "twist"
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class FittedModel:
    """The ``fit``, and the ``form`` that it names: None where no form does."""

    fit: ModelFit
    form: Form | None

    def predict(self, places: Floats, normals: Floats) -> Floats:
        """How far intact skin lies outside the part as designed (N,), at places on it (N,3) with their normals."""
        if self.form is None:
            return np.zeros(len(places))
        T = self.form.T
        at = (places + self.form.displace(places) - T[:3, 3]) @ T[:3, :3]
        return np.asarray(np.einsum("ij,ij->i", at - places, normals))


@dataclass(frozen=True, eq=False)
class AskedFit:
    """The fit of the model (None where it could not be measured) as it was with this ``tolerance`` and ``noise``."""

    fitted: FittedModel | None
    tolerance: float
    noise: float


def measure_fit(
    part: Part, points: Floats, distance: Floats, noise: float, tolerance: float, unit: str,
    views: ViewFits | None, corrected_scale: float = 1.0,
) -> FittedModel | None:  # fmt: skip
    """Measures the fit of points (N,3) in the part's frame with their signed ``distance`` (N,); None where too few lie
    near the skin. ``views``: the comparison of the views, before they were corrected."""
    choice = choose_form(part, points, distance, noise, tolerance)
    if choice is None:
        return None
    half = choice.form.frame.half
    scale, stretch = choice.scale, choice.stretch
    amount, error = _measure_amount(choice, choice.form.fields)
    model, form = _decide(choice, amount, error, tolerance)
    deformation: tuple[tuple[Deformed, float], ...] = ()
    if model == "deformed":
        deformation = _split(choice, amount)
    elif model == "ok":
        amount = 0.0
    deviations, waviness = _measure_patches(choice, choice.form if form else choice.rigid, noise, tolerance)
    if waviness > WAVY * tolerance:  # what fields of low order explain is no waviness
        waviness = min(waviness, _measure_patches(choice, choice.every, noise, tolerance)[1])
    if waviness > WAVY * tolerance and amount < PLAIN * waviness:
        model, form, deformation, amount = "wavy", None, (), 0.0
    if views is not None and views.disagree:
        model = "views disagree"
    fit = ModelFit(
        model=model,  # type: ignore[arg-type]
        words="",
        deviations=deviations,
        scale=1 + float(scale.coefficients[0]) / half,
        scale_error=_measure_scale_error(choice) / half,
        axes=choice.form.frame.axes,
        scale_by_axis=1 + stretch.coefficients / half,
        scale_by_axis_error=np.sqrt(np.diag(stretch.covariance)[6:]) / half,
        deformation=deformation,
        amount=amount,
        amount_error=error,
        views=() if views is None else views.views,
        waviness=waviness,
        corrected_scale=corrected_scale,
        views_from="given" if views is None else views.found_by,
        views_hidden=0.0 if views is None else views.hidden,
    )
    return FittedModel(describe_fit(fit, unit, tolerance), form)


def _decide(choice: FormChoice, amount: float, error: float, tolerance: float) -> tuple[str, Form | None]:
    """The model, and the form that it stands for."""
    if choice.name == "rigid" or amount < max(LEAST_AMOUNT * tolerance, CERTAIN * error):
        return "ok", None
    by_length = [
        abs(float(value)) / choice.form.frame.half
        for field, value in zip(choice.form.fields, choice.form.coefficients, strict=True)
        if field.kind in ("scale", "stretch")
    ]
    if amount > LARGEST_AMOUNT * tolerance or max(by_length, default=0.0) > LARGEST_SCALE:
        return "ok", None
    if choice.name == "scale":
        return ("scaled", choice.form) if _is_one_scale(choice) else ("ok", None)
    before, after = choice.rigid_cells, choice.cells
    size, left = np.abs(before.offset), np.abs(after.offset)
    explained = (size > choice.width / 2) & (size > 2 * left) & (left < choice.width)
    outside = float(before.count[explained & (before.offset > 0)].sum())
    inside = float(before.count[explained & (before.offset < 0)].sum())
    alike = (size > choice.width / 2) & (size < 1.5 * amount)
    if outside + inside < LEAST_EXPLAINED * float(before.count[alike].sum()):
        return "ok", None
    is_sure = len(choice.form.fields) == 1 and amount > SURE * error
    if outside < (OUTSIDE_IF_SURE if is_sure else OUTSIDE) * inside:
        return "ok", None
    return ("scaled" if choice.name == "stretch" else "deformed"), choice.form


def _is_one_scale(choice: FormChoice) -> bool:
    """Whether skin is moved as by a scale, and not as by wear: the axes that show it agree, and they are not one."""
    one = float(choice.scale.coefficients[0])
    by_axis, error = choice.stretch.coefficients, np.sqrt(np.diag(choice.stretch.covariance)[6:])
    shown = error < 0.2 * abs(one)
    agree = np.abs(by_axis - one) < 3 * error + ALIKE * abs(one)
    return bool(shown.sum() >= 2 and agree[shown].all())


def _measure_scale_error(choice: FormChoice) -> float:
    """The standard error of the scale: from the noise, and from how the scales of the axes that show it differ."""
    error = np.sqrt(np.diag(choice.stretch.covariance)[6:])
    shown = error < max(0.2 * abs(float(choice.scale.coefficients[0])), 2 * float(error.min()))
    apart = float(np.std(choice.stretch.coefficients[shown], ddof=1)) if shown.sum() > 1 else 0.0
    return float(np.hypot(np.sqrt(choice.scale.covariance[6, 6]), apart / np.sqrt(max(int(shown.sum()), 1))))


def _measure_amount(choice: FormChoice, fields: tuple[Field, ...]) -> tuple[float, float]:
    """The largest displacement of the seen skin by some fields of the form, and its standard error."""
    if not fields:
        return 0.0, 0.0
    form, places = choice.form, choice.feet.places
    chosen = np.array([field in fields for field in form.fields])
    by_field = form.frame.evaluate(form.fields, places)[chosen]
    by_field = np.array([remove_rigid(places, one, np.ones(len(places))) for one in by_field])
    size = np.linalg.norm(np.einsum("k,knj->nj", form.coefficients[chosen], by_field), axis=1)
    worst = by_field[:, int(np.argmax(size))]
    covariance = form.covariance[6:, 6:][np.ix_(chosen, chosen)]
    return float(size.max()), float(np.sqrt(np.einsum("kj,kl,lj->", worst, covariance, worst)))


def _split(choice: FormChoice, whole: float) -> tuple[tuple[Deformed, float], ...]:
    """The kinds of a deformation with the amount of each, the largest first."""
    found = []
    for kind in dict.fromkeys(_GROUPS.values()):
        fields = tuple(field for field in choice.form.fields if _GROUPS[field.kind] == kind)
        found.append((kind, _measure_amount(choice, fields)[0]))
    found.sort(key=lambda one: -one[1])
    return tuple(one for one in found[:1] + [o for o in found[1:] if o[1] > OWN_SHARE * whole] if one[1] > 0)


def _measure_patches(
    choice: FormChoice, form: Form, noise: float, tolerance: float
) -> tuple[tuple[PatchDeviation, ...], float]:
    """The mean deviations over patches of several widths, and the waviness that the form leaves."""
    feet = choice.feet
    offset = np.einsum("ij,ij->i", feet.normals, feet.points - feet.places)
    left = np.einsum("ij,ij->i", feet.normals, form.undo(feet.points) - feet.places)
    found, waviness = [], 0.0
    intact = np.abs(left) < INTACT * tolerance
    places, normals, offset, left = feet.places[intact], feet.normals[intact], offset[intact], left[intact]
    for size in SIZES:
        patches = Patches.on_skin(places, normals, size * tolerance)
        many = patches.count >= FEWEST_POINTS
        if many.sum() < FEWEST_PATCHES:
            continue
        means = [patches.mean(values)[many] for values in (offset, left)]
        by_noise = float(noise / np.sqrt(np.median(patches.count[many])))
        found.append(PatchDeviation(size * tolerance, _measure_spread(means[0]), by_noise, _measure_spread(means[1])))
        waviness = max(waviness, _measure_waviness(means[1], by_noise))
    return tuple(found), waviness


def _measure_spread(means: Floats) -> float:
    """Half the width of the middle 90 %, in standard deviations of a normal distribution."""
    low, high = np.quantile(means, [0.05, 0.95])
    return float(max(-low, high)) / 1.645


def _measure_waviness(means: Floats, noise: float) -> float:
    """The standard deviation of deviations that lie inside and outside alike, without what noise explains."""
    low, high = np.quantile(means, [0.1, 0.9])
    both = max(float(min(-low, high)), 0.0) / 1.2816
    return float(np.sqrt(max(both**2 - noise**2, 0.0)))
