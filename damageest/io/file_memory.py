"""Memory that reading a file will take, by its size."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from damageest.errors import InputError, StageError
from damageest.isolation.memory import require_memory

TIMES = {
    ".ply": 5, ".pcd": 5, ".npy": 3, ".las": 5, ".laz": 12, ".e57": 9, ".stl": 8, ".obj": 8, ".off": 18, ".ptx": 8,
    ".3mf": 90, ".glb": 8, ".gltf": 8, ".vtk": 6, ".vtp": 12, ".vtu": 12,
}  # fmt: skip
"""Memory over the size of the file, measured on a million points or 300,000 triangles and rounded up; 3MF is packed."""
OTHER = 5
"""The same for text."""


def require_memory_for(paths: Sequence[Path]) -> None:
    """Raises InputError where reading the files would take more memory than is free, with both figures. Files that are
    missing are left to their reader."""
    sizes = {path: path.stat().st_size for path in paths if path.is_file()}
    needed = sum(TIMES.get(path.suffix.lower(), OTHER) * size for path, size in sizes.items())
    what = "a file" if len(sizes) == 1 else f"{len(sizes)} files"
    try:
        require_memory(needed, f"reading {what} of {sum(sizes.values()) / 1e6:.0f} MB", "")
    except StageError as error:
        raise InputError(
            f"{next(iter(sizes))}: {error.message}\n  try: a machine with more memory, a larger --memory, or a file "
            "with fewer points or triangles",
            code="memory",
        ) from None
