"""The octree difference of part and scan: method `octree`, for comparison with the default route."""

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """What this plugin provides."""
    from damageest_octree.octree import Octree

    return [Octree]
