"""The beam of energy, powder or wire between the nozzle's tip and the bead: what it must not meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damageest_paths.tool.nozzle import Cone, Nozzle, make_nozzle

SLACK = 0.05
"""Share of its radius by which the beam that is checked is thinner, so that a bead may lie flush against a wall."""
LIFT, NEED = 0.05, 0.02
"""Shares of the beam's radius: how far above the bead the check begins, and the distance that it asks for."""
SPACING = 0.5
"""Share of its radius by which it moves at most from one pose that is checked to the next: it is round, so that what
stands between both reaches into it by 3 % of the radius at most, less than `SLACK`."""
BEGIN = np.radians(45.0)
"""Half the angle of the cone with which the beam that is checked begins: a tilted beam that is as wide as the bead at
the bead meets the metal beside it, where it melts."""


@dataclass(frozen=True)
class Beam:
    """``radius`` at the bead; ``cone``: half the angle, in radians, by which it widens from the bead to the tip;
    ``incidence``: its largest angle, in radians, with the layer's normal."""

    radius: float
    cone: float
    incidence: float

    def measure_radius(self, height: float) -> float:
        """Its radius at a height above the bead."""
        return self.radius + height * float(np.tan(self.cone))

    @property
    def lift(self) -> float:
        return LIFT * self.radius

    @property
    def needed(self) -> float:
        """The distance that has to be free round the bodies of `draw`."""
        return NEED * self.radius

    @property
    def spacing(self) -> float:
        """The way by which it may move between two poses at which it is checked."""
        return SPACING * self.radius

    def draw(self, standoff: float) -> Sequence[Nozzle]:
        """Bodies that the beam fills from `lift` above the bead up to the tip: a cylinder with a pointed end, and where
        the beam widens the cone from the bead to its width at the tip."""
        length = max(standoff - self.lift, self.lift)
        thin = (1 - SLACK) * self.radius
        found = [make_nozzle(Cone(0.0, thin, max(length, 1.01 * thin / np.tan(BEGIN)), BEGIN))]
        if self.cone > 0:
            wide = (1 - SLACK) * self.measure_radius(length)
            found.append(make_nozzle(Cone(0.0, wide, 1.01 * length, float(np.arctan(wide / length)))))
        return found
