"""What all values between stages share: types of arrays, and arrays that nobody can edit."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Vector = tuple[float, float, float]


class ArtefactError(ValueError):
    """The data do not fit the artefact's type: wrong shapes, indices out of range, a solid that is not closed."""


def _freeze(value: Any, dtype: Any) -> Any:
    array = np.array(value, dtype=dtype, order="C", copy=None)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


class Arrays:
    """Converts the array fields named in ``_dtypes`` and makes them read-only when the dataclass is made."""

    _dtypes: ClassVar[dict[str, Any]] = {}

    def __post_init__(self) -> None:
        for name, dtype in self._dtypes.items():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _freeze(value, dtype))
