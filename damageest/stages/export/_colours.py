"""Colours of what is written, red, green and blue from 0 to 255."""

from __future__ import annotations

import numpy as np

UNDAMAGED, DAMAGE, DEPOSIT, DOUBTFUL = (150, 155, 165), (215, 50, 40), (40, 130, 205), (225, 165, 40)
SURPLUS, MILLED = (150, 90, 190), (235, 200, 60)
LABELLED = np.array([UNDAMAGED, DAMAGE, SURPLUS, (90, 90, 90)], np.uint8)
"""Colour of a scan point by its label: intact, damage, added, outlier."""
