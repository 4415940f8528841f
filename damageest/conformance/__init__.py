"""Checks for authors of stages: subclass the class of your contract in a test file and set ``stage``.

    class TestMine(BooleanContract):
        stage = Mine()

There are classes for `sample`, `repair`, `boolean` and `allowance`.
"""

from __future__ import annotations

try:
    import pytest  # noqa: F401
except ImportError as error:
    raise ImportError("damageest.conformance needs pytest: pip install pytest") from error

from damageest.conformance._contracts import AllowanceContract, BooleanContract, RepairContract, SampleContract

__all__ = ["AllowanceContract", "BooleanContract", "RepairContract", "SampleContract"]
