"""What result.json says of the pose, its datums, and motions that they or unworn skin do not fix."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import DatumFit, Floats, FreeMotion, Pose, Vector
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
    fields="transform quaternion translation rms inliers alternatives notes doubts free datums left held rescaled",
):
    transform: Matrix = Field(description="T_part_scan, 4x4: from the scanner's frame to the part's")
    quaternion: tuple[float, float, float, float] = Field(
        description="rotation as a quaternion: w, x, y, z; w is not negative"
    )
    translation: Vector = Field(description="shift, after the rotation")
    alternatives: list[Matrix]
    left: list[LeftMotionReport]
    held: bool = Field(description="whether unworn skin fixes all other motions")
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
