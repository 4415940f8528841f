"""Enclosures made watertight by MeshFix."""

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """What this plugin provides."""
    from damageest_pymeshfix.repair import PyMeshFix

    return [PyMeshFix]
