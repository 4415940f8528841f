"""What result.json says of a part that was deformed to follow its scan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import AdaptedPart, PriorUse, Vector
from damageest.geometry.barycentric import find_barycentric
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.stiff_modes import StiffMode, name_modes
from damageest.output.base import JsonModel
from damageest.result import Site

PLACES = 4000
"""Places on the skin by which the displacement is named."""


class StiffModeReport(JsonModel, of=StiffMode):
    kind: Literal["scale", "stretch", "bend", "twist", "taper"]


class HeldOutReport(JsonModel):
    """Cross-validation: the scan is cut into patches, half of which are held out of a fit to the others."""

    patches: int = Field(description="patches of the scan")
    rigid: float = Field(description="root mean square residual of the part as designed in them, outliers limited")
    adapted: float = Field(description="the same residual of the adapted part")


class ExtrapolationReport(JsonModel):
    site: int
    distance: float = Field(description="from intact skin to the farthest place of the skin that is lost")
    deviation: float = Field(description="largest standard deviation of the adapted skin there, along its normal")


class PriorReport(JsonModel, of=PriorUse, fields="used=is_used parts misfit limit"):
    """Prediction by the job's other parts of the type."""


class AdaptReport(
    JsonModel,
    of=AdaptedPart,
    fields="amount where rms growth strain modes left lattice functions gain cross_validation extrapolation prior "
    "motion",
):
    """How the part as designed was deformed. Sites, damage and coordinates are those of the deformed part."""

    where: Vector | None = Field(description="position of the largest displacement on the deformed part; null: unknown")
    modes: list[StiffModeReport] = Field(description="modes of the displacement, the largest first")
    left: float = Field(description="root mean square displacement outside these modes")
    cross_validation: HeldOutReport
    extrapolation: list[ExtrapolationReport] = Field(description="extrapolation of the field into each site")
    motion: list[list[float]]


def report_adapt(adapted: AdaptedPart | None, sites: Sequence[Site]) -> AdaptReport | None:
    """The deformation as values for JSON."""
    if adapted is None:
        return None
    modes, left = _name(adapted)
    before, after = adapted.held_out
    prior = adapted.prior
    return AdaptReport.read(
        adapted,
        where=find_largest(adapted),
        modes=modes,
        left=left,
        cross_validation=HeldOutReport(patches=adapted.patches, rigid=before, adapted=after),
        extrapolation=[
            ExtrapolationReport(
                site=site.id, distance=site.uncertainty.extrapolated, deviation=site.uncertainty.extrapolated_error
            )
            for site in sites
            if site.uncertainty is not None
        ],
        prior=prior and PriorReport.read(prior, used=prior.is_used),
    )


def find_largest(adapted: AdaptedPart) -> Vector | None:
    """The place on the adapted part where seen skin is displaced most."""
    if adapted.seen is None or adapted.field is None or not len(adapted.seen):
        return None
    moved = adapted.field.displace(adapted.seen)
    most = int(np.linalg.norm(moved, axis=1).argmax())
    x, y, z = (adapted.seen[most] + moved[most]).tolist()
    return x, y, z


def _name(adapted: AdaptedPart) -> tuple[list[StiffMode], float]:
    """The displacement's modes over the whole skin."""
    places, face = sample_by_area(adapted.part, PLACES, np.random.default_rng(3))
    weights = find_barycentric(adapted.part.take_triangles(face), places)
    moved = np.einsum("nc,nck->nk", weights, adapted.displacement[adapted.part.faces[face]])
    return name_modes(places - moved, moved)
