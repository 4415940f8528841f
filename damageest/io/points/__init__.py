"""Readers of point clouds, one module per family of formats, each imported only when a file asks for it."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path

from damageest.artefacts import Floats
from damageest.errors import InputError
from damageest.io.files import check_file, raise_environment_fault, shorten_error


@dataclass(frozen=True)
class PointFile:
    """Points (N,3) as the file has them, finite or not; normals (N,3) or None; the unit where the format states one."""

    points: Floats
    normals: Floats | None = None
    unit: str | None = None
    notes: tuple[str, ...] = ()


class FormatError(ValueError):
    """The file is not what its suffix says; the text tells what is wrong with it."""


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
    ".las": "las",
    ".laz": "las",
    ".e57": "e57",
}
"""Suffix to the module here whose ``read(path, columns)`` gives a `Cloud`."""


def read_points(path: Path, columns: str | None = None) -> PointFile:
    """The points of one file. Raises InputError, naming the file, where it cannot be read or holds no points."""
    suffix = check_file(path, tuple(READERS), "a scan")
    module = importlib.import_module(f"{__name__}.{READERS[suffix]}")
    try:
        cloud: PointFile = module.read(path, columns)
    except FormatError as error:
        raise InputError(f"{path}: {error}") from None
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # the readers' libraries raise anything on a broken file, some outside Exception
        raise_environment_fault(error)
        raise InputError(f"{path}: not a readable {suffix} file ({shorten_error(error)})") from None
    if not len(cloud.points):
        raise InputError(f"{path}: holds no points")
    return cloud
