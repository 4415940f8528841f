"""What certificate and temperature say of the whole scan, and whether the scan contradicts them."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Part, Reason, Scan
from damageest.geometry.scan_field import ScanField
from damageest.job.scanner import Certificate, ScannerInfo, Temperature
from damageest.pipeline.state import Reasons
from damageest.rules import ScanFacts
from damageest.trust.interval.pose_error import PoseError
from damageest.trust.interval.scanner import FORM_RANGE, REFERENCE, Figure, ScannerErrors, leave_form, spread_of
from damageest.trust.interval.site_error import WIDTH
from damageest.trust.model_fit import FittedModel

FAR = 1.5
"""How many times larger than the certificate says the noise has to be, to contradict it."""


def weigh_scanner(
    scanner: ScannerInfo | None, temperature: Temperature | None, corrected_scale: float, fitted: FittedModel | None,
    field: ScanField, pose_error: PoseError, facts: ScanFacts, unit: str,
) -> tuple[ScannerErrors, Reasons]:  # fmt: skip
    """Turns certificate and temperature into errors of the whole scan, and warns where the scan contradicts them."""
    certificate, part, aligned = (scanner and scanner.certificate) or Certificate(), field.part, field.aligned
    terms, unknown = [], []
    if certificate.probing_size is None:
        unknown.append("probing_size")
    else:
        size, shape = spread_of(certificate.probing_size, certificate.k)
        terms.append(Figure("probing_size", size, unit, 0.5, shape))
    if corrected_scale != 1 and fitted is not None:
        terms.append(Figure("fitted_scale", fitted.fit.scale_error, "", 1.0, "normal"))
    else:
        scales, missing = _list_scales(certificate, temperature, part.diagonal)
        terms += scales
        unknown += missing
    systematic = max(pose_error.systematic, facts.systematic)
    form = 0.0
    if certificate.probing_form is None:
        unknown.insert(0, "probing_form")
    else:
        form = leave_form(certificate.probing_form, aligned.noise, systematic)
    words = [scanner.name if scanner else "", certificate.standard, f"k = {certificate.k:g}" if certificate.k else ""]
    errors = ScannerErrors(tuple(terms), form, tuple(unknown), ", ".join(filter(None, words)))
    return errors, (*_compare_noise(certificate, aligned, unit), *_compare_scale(errors, fitted, part, temperature))


def _list_scales(
    certificate: Certificate, temperature: Temperature | None, diagonal: float
) -> tuple[list[Figure], list[str]]:
    """The errors of the scale, and what is not known of them."""
    terms: list[Figure] = []
    unknown: list[str] = []
    if certificate.length_error is None:
        unknown.append("length")
    else:
        most, shape = spread_of(certificate.length_error.at(diagonal), certificate.k)
        terms.append(Figure("length", most / diagonal, "", 1.0, shape))
    if temperature is None:
        return terms, [*unknown, "temperature"]
    figures = (
        ("temperature", temperature.uncertainty, "K", temperature.expansion),
        ("expansion", temperature.expansion_uncertainty, "1/K", temperature.part - REFERENCE),
    )
    for name, value, unit, rate in figures:
        if value is None:
            unknown.append(f"{name}_uncertainty")
        else:
            spread, shape = spread_of(value, temperature.k)
            terms.append(Figure(name, spread, unit, rate, shape))
    return terms, unknown


def _compare_noise(certificate: Certificate, aligned: Scan, unit: str) -> Reasons:
    """A warning where the points scatter by far more than the certificate says."""
    form, measured = certificate.probing_form, FORM_RANGE * aligned.noise
    if form is None or measured <= FAR * form:
        return ()
    text = (
        f"the scan contradicts its certificate: 95 % of the points scatter over {measured:.3g} {unit}, the probing "
        f"form error is {form:.3g} {unit}; the measured noise counts"
    )
    remedy = "check certificate, settings and surface (gloss, roughness, spray)"
    return [Reason("certificate", text, amount=measured, unit=unit, remedy=remedy)]


def _compare_scale(
    errors: ScannerErrors, fitted: FittedModel | None, part: Part, temperature: Temperature | None
) -> Reasons:
    """A warning where the scan is larger or smaller than the part by more than certificate and temperature allow."""
    names = {one.name for one in errors.terms}
    if fitted is None or "length" not in names:
        return ()
    off, error = fitted.fit.scale - 1, fitted.fit.scale_error
    # an offset of the surface looks as a scale of half of the part's width
    as_scale = errors.offset / (part.bounds[1] - part.bounds[0]).min() * 2
    most = WIDTH * float(np.linalg.norm([errors.scale, error, as_scale]))
    if abs(off) <= most:
        return ()
    text = (
        f"the scan is {100 * abs(off):.2g} % {'larger' if off > 0 else 'smaller'} than the part, and the certificate"
        f"{' and the temperature' if temperature else ''} allow {100 * most:.2g} %"
    )
    remedy = "" if temperature else "give the part's temperature (steel grows by 0.009 % from 20 to 28 °C)"
    return [Reason("certificate", text, amount=100 * off, unit="%", remedy=remedy)]
