"""Shallow damage enclosed by a sweep: a complete plugin, small enough to start your own from."""

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """The implementations of this plugin."""
    from damageest_sweep.sweep import Sweep

    return [Sweep]
