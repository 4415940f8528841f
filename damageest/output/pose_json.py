"""What result.json says of the pose, its datums, motions that nothing fixes, and of the model fit."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import DatumFit, Floats, FreeMotion, Pose, Vector
from damageest.findings import Deformed, ModelFit, PatchDeviation, ViewFit
from damageest.output.base import JsonModel
from damageest.result import Result

Matrix = list[list[float]]


class FreeMotionReport(JsonModel, of=FreeMotion, fields="direction point low high turn text"):
    """One motion of the scan after which it fits as well."""


class LeftMotionReport(JsonModel, of=FreeMotion, fields="direction point text"):
    """A motion that a datum system leaves free, and that the rest of the skin fixes."""


class DatumReport(JsonModel, of=DatumFit, without=("shapes", "places", "axes", "bores")):
    """How a datum of a datum system was fitted."""


class RescaledReport(JsonModel):
    factor: float = Field(description="divisor of the scan's lengths, for temperature and scale")
    centre: Vector = Field(description="the place in the scanner's frame about which they were, which stays")


class AlignmentReport(
    JsonModel,
    of=Pose,
    fields="transform quaternion translation rms inliers alternatives notes doubts free datums left held=is_held "
    "rescaled",
):
    transform: Matrix = Field(description="T_part_scan, 4x4: from the scanner's frame to the part's")
    quaternion: tuple[float, float, float, float] = Field(
        description="rotation as a quaternion: w, x, y, z; w is not negative"
    )
    translation: Vector = Field(description="shift, after the rotation")
    alternatives: list[Matrix]
    left: list[LeftMotionReport]
    rescaled: RescaledReport | None = Field(
        None,
        description="only where the lengths of the scan were corrected: a raw point x is at "
        "transform (centre + (x - centre) / factor) in the part",
    )


def report_alignment(result: Result) -> AlignmentReport:
    """The pose as values for JSON."""
    pose, factor, centre = result.pose, result.scan_factor, result.scan_centre
    return AlignmentReport.read(
        pose,
        transform=pose.T_part_scan,
        quaternion=_to_quaternion(pose.T_part_scan),
        translation=pose.T_part_scan[:3, 3],
        alternatives=[] if pose.alternatives is None else pose.alternatives,
        held=pose.is_held,
        rescaled=None if factor == 1 or centre is None else RescaledReport(factor=factor, centre=centre),
    )


def _to_quaternion(T: Floats) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True).tolist()
    return w, x, y, z


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
