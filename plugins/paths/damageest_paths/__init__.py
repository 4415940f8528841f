"""Deposition paths: passes layer by layer, checked against collision of the nozzle."""

# The modules:
# layers.py: options
# planar.py, conformal.py: layers
# fill.py, weave.py, joints.py, stripes.py: patterns; passes joined
# clearance.py, axes.py, pose_table.py: nozzle, tool axes, which of them are free
# aims.py, sight.py, trim.py: where beads may lie, and the beam
# directions.py: build directions
# drafts.py: passes and what they fill
# moves.py, network.py: ways between passes
# channels.py, settings.py, places.py, interpass.py: the process by place, and waits
# calibration.py: beads by trial
# beads.py: the resulting beads
# anchor.py, foot.py: beads on the floor and over air
# assemble.py: the path, its figures and notes

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """The implementations of this plugin."""
    from damageest_paths.layers import Layers

    return [Layers]
