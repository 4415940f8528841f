"""Damage surfaces and mesh Booleans by PyMeshLab."""

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """What this plugin provides. Raises PluginError where a system library that PyMeshLab loads is not there."""
    from damageest_pymeshlab._system import check

    check()
    from damageest_pymeshlab.boolean import PyMeshLabBoolean
    from damageest_pymeshlab.reconstruct import PyMeshLabReconstruct

    return [PyMeshLabReconstruct, PyMeshLabBoolean]
