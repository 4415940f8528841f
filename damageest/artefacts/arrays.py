"""Types of arrays that all values between stages share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Bytes = NDArray[np.uint8]
Singles = NDArray[np.float32]
Vector = tuple[float, float, float]
