"""Memory that reading a file will take, by its size."""

from __future__ import annotations

from pathlib import Path

from damageest.errors import InputError, StageError
from damageest.isolation.memory import require_memory

TIMES = {
    ".ply": 5, ".pcd": 5, ".npy": 3, ".las": 5, ".laz": 12, ".e57": 9, ".stl": 8, ".obj": 8, ".off": 18, ".ptx": 8,
    ".3mf": 90,
}  # fmt: skip
"""Memory over the size of the file, measured on a million points or 300,000 triangles and rounded up; 3MF is packed."""
OTHER = 5
"""The same for text."""


def require_memory_for(path: Path) -> None:
    """Raises InputError where reading the file would take more memory than is free, with both figures."""
    needed = TIMES.get(path.suffix.lower(), OTHER) * path.stat().st_size
    try:
        require_memory(needed, f"reading a file of {path.stat().st_size / 1e6:.0f} MB", "")
    except StageError as error:
        raise InputError(
            f"{path}: {error.message}\n  try: a machine with more memory, a larger --memory, or a file with fewer "
            "points or triangles"
        ) from None
