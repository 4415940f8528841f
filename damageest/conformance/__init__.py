"""Checks for authors of stage implementations: subclass the class of your contract in a test file and set ``stage``.

    class TestMine(BooleanContract):
        stage = Mine()

Every contract has a class. If an implementation cannot pass a check, name the check in ``exceptions`` with the reason.
The docstring of a class describes its other attributes; `StageContract` describes those of all classes.
"""

from __future__ import annotations

try:
    import pytest
except ImportError as error:
    raise ImportError("damageest.conformance needs pytest: pip install pytest") from error

# a check that fails then shows the values that it compared
pytest.register_assert_rewrite(
    *(
        f"{__name__}.{name}"
        for name in (
            "_adapt",
            "_base",
            "_contracts",
            "_enclose",
            "_files",
            "_path",
            "_points",
            "_report",
            "_surface",
            "_written",
        )
    )
)

from damageest.conformance._adapt import AdaptContract  # noqa: E402
from damageest.conformance._base import StageContract  # noqa: E402
from damageest.conformance._contracts import AllowanceContract, BooleanContract, RepairContract, SampleContract  # noqa: E402
from damageest.conformance._enclose import EncloseAllContract, EncloseContract  # noqa: E402
from damageest.conformance._files import ExportContract, PartContract, ScanContract  # noqa: E402
from damageest.conformance._path import PathContract  # noqa: E402
from damageest.conformance._points import NEAR, AlignContract, ClusterContract, SegmentContract  # noqa: E402
from damageest.conformance._report import ReportContract  # noqa: E402
from damageest.conformance._surface import BackgroundContract, BoundaryContract, ReconstructContract  # noqa: E402

__all__ = [
    "NEAR",
    "AdaptContract",
    "AlignContract",
    "AllowanceContract",
    "BackgroundContract",
    "BooleanContract",
    "BoundaryContract",
    "ClusterContract",
    "EncloseAllContract",
    "EncloseContract",
    "ExportContract",
    "PartContract",
    "PathContract",
    "ReconstructContract",
    "RepairContract",
    "ReportContract",
    "SampleContract",
    "ScanContract",
    "SegmentContract",
    "StageContract",
]
