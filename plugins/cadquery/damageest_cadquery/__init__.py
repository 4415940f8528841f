"""Parts from STEP, IGES and BREP files, and results as STEP, by CadQuery and OpenCASCADE."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from damageest import hookimpl
from damageest.stages import Stage

if TYPE_CHECKING:
    from damageest.result import Conversion
    from damageest.stages.export import Writer


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """What this plugin provides. Raises PluginError where a system library that OpenCASCADE loads is missing."""
    from damageest_cadquery._system import check

    check()
    from damageest_cadquery.brep import Brep

    return [Brep]


@hookimpl
def damageest_writers() -> Mapping[str, Writer]:
    """STEP, of solids and splines."""
    from damageest.stages.export import Writer
    from damageest_cadquery.writing.patch import write_patch
    from damageest_cadquery.writing.step import write_step

    return {"step": Writer(write_step, simplify=True, patch=write_patch, exact=_write_exact)}


@hookimpl
def damageest_conversions() -> Mapping[str, Conversion]:
    """`Result.as_cadquery`."""
    return {"cadquery": _as_cadquery}


def _as_cadquery(*values: Any) -> Any:
    from damageest_cadquery.exact import as_cadquery  # imported late: it takes a second

    return as_cadquery(*values)


def _write_exact(*values: Any) -> Any:
    from damageest_cadquery.exact import write_exact  # imported late: it takes a second

    return write_exact(*values)
