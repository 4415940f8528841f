"""Readers of point clouds, with one module per family of formats.

To add a format, add a module here with ``read(path, columns) -> PointFile``. ``columns`` names the columns of text.
It raises `FormatError` with what is wrong in the file, and imports its library inside ``read``.
Where the file says where its scanner stood, the reader gives `viewpoints` and `view` too.
Add a line to READERS: the suffix, and the module's name. `read_points` imports the module when it is needed.
Add a file of tests in tests/io: a good file, a truncated one, one without points, and one of another format.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path

from damageest.artefacts import Bytes, Flags, Floats, Ints, Singles, take_points
from damageest.errors import InputError
from damageest.io.file_memory import require_memory_for
from damageest.io.files import check_file, raise_environment_fault, shorten_error


@dataclass(frozen=True)
class PointFile:
    """The content of one file.

    ``points`` (N,3), which may be not finite; ``normals`` (N,3) or None; ``unit`` if the file states one, else None.
    ``unit_said``: the line of the file that states it; empty where the standard of the format does.
    ``columns``: which columns of a text file are x, y and z, and why; empty where it can only be the first three.
    ``colours`` (N,3), 0 to 255, or None; ``confidence`` (N,) of each point, on the file's own scale, or None.
    ``viewpoints`` (V,3): scanner positions in the frame of the points; ``view`` (N,): the number of each point's
    position, -1 where it is not known. Both None where the file has none.
    """

    points: Floats
    normals: Floats | None = None
    unit: str | None = None
    notes: tuple[str, ...] = ()
    viewpoints: Floats | None = None
    view: Ints | None = None
    colours: Bytes | None = None
    confidence: Singles | None = None
    unit_said: str = ""
    columns: str = ""

    def take(self, keep: Flags) -> PointFile:
        """The file with some of its points: whether each (N,) is taken."""
        return take_points(self, keep)


class FormatError(ValueError):
    """The file is not a valid file of its format. The message says what is wrong."""


READERS = {
    ".ply": "ply",
    ".pcd": "pcd",
    ".xyz": "text",
    ".txt": "text",
    ".pts": "text",
    ".asc": "text",
    ".csv": "text",
    ".npy": "npy",
    ".stl": "mesh",
    ".obj": "mesh",
    ".off": "mesh",
    ".3mf": "mesh",
    ".glb": "gltf",
    ".gltf": "gltf",
    ".vtk": "vtk",
    ".vtp": "vtk",
    ".vtu": "vtk",
    ".las": "las",
    ".laz": "las",
    ".e57": "e57",
    ".ptx": "ptx",
}
"""Suffix of a file: the module of this folder that reads it."""


def read_points(path: Path, columns: str | None = None) -> PointFile:
    """The points of one file. Raises InputError, which names the file, if it cannot be read or has no points."""
    suffix = check_file(path, tuple(READERS), "a scan")
    require_memory_for([path])
    module = importlib.import_module(f"{__name__}.{READERS[suffix]}")
    try:
        cloud: PointFile = module.read(path, columns)
    except FormatError as error:
        raise InputError(f"{path}: {error}") from None
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # libraries raise any error on a broken file, some not an Exception
        raise_environment_fault(error)
        raise InputError(f"{path}: cannot be read as a {suffix} file ({shorten_error(error)})") from None
    if not len(cloud.points):
        raise InputError(f"{path}: has no points")
    return cloud
