"""What result.json says of the model fit."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import Vector
from damageest.findings import Deformed, ModelFit, PatchDeviation, ViewFit
from damageest.output.base import JsonModel


class PatchReport(JsonModel, of=PatchDeviation): ...


class ScaleReport(JsonModel):
    value: float = Field(description="length in the scan over length in the CAD, best fit")
    error: float = Field(description="standard error of the scale")
    axes: tuple[Vector, Vector, Vector] = Field(description="directions of by_axis, in the part's frame")
    by_axis: Vector
    by_axis_error: Vector
    corrected: float = Field(description="the scale that was taken out of the scan before; 1: none")


class DeformationReport(JsonModel):
    kind: Deformed
    amount: float = Field(description="largest displacement of the seen skin by it beyond the nearest rigid motion")


class ViewReport(JsonModel, of=ViewFit, without=("is_elsewhere",)):
    shift: Vector


class FitReport(
    JsonModel,
    of=ModelFit,
    fields="model words deviations scale deformation amount amount_error views views_from views_hidden waviness",
):
    """How well the part as designed, in one rigid pose, explains the intact skin."""

    scale: ScaleReport
    deformation: list[DeformationReport] = Field(description="empty where the model is not deformed")


def report_fit(fit: ModelFit | None) -> FitReport | None:
    """The fit as values for JSON; None where too few points lie near the skin."""
    if fit is None:
        return None
    scale = ScaleReport.read(
        fit,
        value=fit.scale,
        error=fit.scale_error,
        by_axis=fit.scale_by_axis,
        by_axis_error=fit.scale_by_axis_error,
        corrected=fit.corrected_scale,
    )
    deformation = [DeformationReport(kind=kind, amount=amount) for kind, amount in fit.deformation]
    views = [ViewReport.read(view, number=view.number + 1) for view in fit.views]
    return FitReport.read(fit, scale=scale, deformation=deformation, views=views)
