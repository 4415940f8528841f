"""Deposition paths: passes layer by layer, checked against collision of the nozzle."""

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """The implementations of this plugin."""
    from damageest_paths.layers import Layers

    return [Layers]
