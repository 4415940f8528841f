"""Parts from STEP, IGES and BREP files, by CadQuery and OpenCASCADE."""

from __future__ import annotations

from damageest.hookspecs import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """What this plugin provides."""
    from damageest_cadquery.brep import Brep

    return [Brep]
