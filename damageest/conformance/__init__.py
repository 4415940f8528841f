"""Checks for authors of stages: subclass the class of your contract in a test file and set ``stage``.

    class TestMine(BooleanContract):
        stage = Mine()

There is a class for every contract.
"""

from __future__ import annotations

try:
    import pytest  # noqa: F401
except ImportError as error:
    raise ImportError("damageest.conformance needs pytest: pip install pytest") from error

from damageest.conformance._contracts import AllowanceContract, BooleanContract, RepairContract, SampleContract
from damageest.conformance._enclose import EncloseAllContract, EncloseContract

__all__ = [
    "AllowanceContract",
    "BooleanContract",
    "EncloseAllContract",
    "EncloseContract",
    "RepairContract",
    "SampleContract",
]
