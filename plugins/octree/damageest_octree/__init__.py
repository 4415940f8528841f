"""Method `octree`: the octree of the part minus the octree of the damaged part. For comparison with other methods."""

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """The implementations of this plugin."""
    from damageest_octree.octree import Octree

    return [Octree]
