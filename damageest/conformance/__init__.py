"""Checks for authors of stage implementations: subclass the class of your contract in a test file and set ``stage``.

    class TestMine(BooleanContract):
        stage = Mine()

Every contract has a class. If an implementation cannot pass a check, name the check in ``exceptions`` with the reason.
The docstring of a class describes its other attributes; `StageContract` describes those of all classes.
"""

from __future__ import annotations

try:
    import pytest  # noqa: F401
except ImportError as error:
    raise ImportError("damageest.conformance needs pytest: pip install pytest") from error

from damageest.conformance._base import StageContract
from damageest.conformance._contracts import AllowanceContract, BooleanContract, RepairContract, SampleContract
from damageest.conformance._enclose import EncloseAllContract, EncloseContract
from damageest.conformance._files import ExportContract, PartContract, ScanContract
from damageest.conformance._points import NEAR, AlignContract, ClusterContract, SegmentContract
from damageest.conformance._surface import BackgroundContract, BoundaryContract, ReconstructContract

__all__ = [
    "NEAR",
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
    "ReconstructContract",
    "RepairContract",
    "SampleContract",
    "ScanContract",
    "SegmentContract",
    "StageContract",
]
