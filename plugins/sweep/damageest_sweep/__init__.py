"""Shallow damage enclosed by a sweep. An example of a plugin, complete and small enough to copy."""

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """What this plugin provides."""
    from damageest_sweep.sweep import Sweep

    return [Sweep]
