"""NumPy's own format: an array (N,3), or (N,6) with normals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from damageest.io.points import FormatError, PointFile


def read(path: Path, columns: str | None = None) -> PointFile:
    """An array of numbers. Pickles are not read, because they can run code."""
    try:
        _check_size(path)
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise FormatError(f"cannot be read as a NumPy array ({error})") from None
    if (
        not isinstance(array, np.ndarray)
        or array.ndim != 2
        or array.shape[1] not in (3, 6)
        or array.dtype.kind not in "fiu"
    ):
        what = f"{array.shape} of {array.dtype}" if isinstance(array, np.ndarray) else "an archive of several arrays"
        raise FormatError(f"needs an array of numbers with the shape (N,3), or (N,6) with normals, but holds {what}")
    return PointFile(array[:, :3], array[:, 3:] if array.shape[1] == 6 else None)


def _check_size(path: Path) -> None:
    """Raises ValueError where the header announces more than the file has, before memory is allocated for it."""
    with path.open("rb") as stream:
        version = np.lib.format.read_magic(stream)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0}.get(version, np.lib.format.read_array_header_2_0)
        shape, _, kind = read_header(stream)
        needed = math.prod(shape) * kind.itemsize
        have = path.stat().st_size - stream.tell()
    if min(shape, default=0) < 0 or needed > have:
        raise ValueError(f"its header has the shape {shape}, and the file has {have} bytes for it")
