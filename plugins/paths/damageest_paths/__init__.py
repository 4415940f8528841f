"""Deposition paths: passes layer by layer, checked against collision of the nozzle."""

# The rooms, from the top to the bottom: layering/, travel/ and holding/, sheets/, clearance/, process/,
# tool/ and fill/
# The modules:
# layers.py: options
# assemble.py: the path, its figures and notes
# drafts.py: passes and what they fill
# form_choice.py: planes, or surfaces along the floor
# beads.py, stamping.py, laid.py: the resulting beads
# foot.py: beads over air

from __future__ import annotations

from damageest import hookimpl
from damageest.stages import Stage


@hookimpl
def damageest_stages() -> list[type[Stage]]:
    """The implementations of this plugin."""
    from damageest_paths.layers import Layers

    return [Layers]
