"""An output folder, read again to be shown."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Mesh
from damageest.errors import InputError
from damageest.io.files import read_json, shorten_error
from damageest.io.meshes import read_mesh

PLY_TYPES = {"double": "<f8", "float": "<f4", "uchar": "u1", "int": "<i4"}


@dataclass(frozen=True, eq=False)
class LabelledScan:
    """The aligned scan: ``points`` (N,3), ``distance`` (N,) signed to the skin, ``site`` (N,), 0 for none."""

    points: Floats
    distance: Floats
    site: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class WrittenPath:
    """A deposition path, in the frame of the other files: ``points`` (N,3) on the tops of the beads, whether the move
    that ends there deposits (N,), its ``layer`` (N,), counted over the parts of the deposit, and the bead's ``width``.
    """

    points: Floats
    on: NDArray[np.bool_]
    layer: NDArray[np.int64]
    width: float


@dataclass(frozen=True)
class OutputFolder:
    """What a run wrote into ``folder``; ``content`` is that of result.json."""

    folder: Path
    content: dict[str, Any]

    @property
    def unit(self) -> str:
        return str(self.content["units"])

    @property
    def site_numbers(self) -> list[int]:
        return [site["id"] for site in self.content["sites"]]

    @cached_property
    def place(self) -> Path:
        """Where the files in the part's frame are; where there are none, those in the scan's, or those on the part as
        designed."""
        if (self.folder / "scan.ply").is_file():
            return self.folder
        others = (self.folder / name for name in ("scan_frame", "nominal_frame"))
        return next((other for other in others if other.is_dir()), self.folder)

    @cached_property
    def _in_one_file(self) -> dict[str, Any]:
        """Solids of 3MF files, by their names there."""
        import trimesh

        found: dict[str, Any] = {}
        for name in ("result.3mf", "doubtful/result.3mf"):
            if (self.place / name).is_file():
                found |= trimesh.load_scene(self.place / name, process=False).geometry
        return found

    def read_solid(self, kind: str, site: int = 0) -> Mesh | None:
        """A solid: ``kind`` undamaged, damage, deposit or surplus; None where no file holds it that can be read."""
        stems = [kind] if not site else [f"{kind}/site-{site}"]
        if kind == "damage" and site:
            stems.append(f"doubtful/site-{site}")
        for stem in stems:
            for suffix in (".ply", ".stl"):
                if (path := self.place / f"{stem}{suffix}").is_file():
                    return _read(path)
        words = {"undamaged": ["undamaged part"], "damage": [f"damage site-{site}", f"doubtful site-{site}"]}
        for name in words.get(kind, [f"{kind} site-{site}"]):
            if name in self._in_one_file:
                body = self._in_one_file[name]
                return Mesh(body.vertices, body.faces)
        return None

    def read_mesh(self, name: str) -> Mesh | None:
        """An open mesh by the path of its file in the folder, as ``skin.ply``; None where there is none."""
        path = self.place / name
        return _read(path) if path.is_file() else None

    def read_surface(self, site: int) -> Mesh | None:
        """The inner damage surface of a site."""
        found = self.read_mesh(f"surface/site-{site}.ply")
        return found if found is not None else self.read_mesh(f"doubtful/surface/site-{site}.ply")

    def read_path(self, site: int) -> WrittenPath | None:
        """The deposition path of a site from the table that ``export: {paths: csv}`` writes; None without one.

        Raises InputError where it cannot be read."""
        path = self.place / f"path/site-{site}.csv"
        if not path.is_file():
            return None
        try:
            with path.open(newline="", encoding="utf-8") as stream:
                rows = list(csv.DictReader(stream))
            points = np.array([[float(row[name]) for name in "xyz"] for row in rows])
            on = np.array([row["on"] == "1" for row in rows])
            parts = np.array([(int(row["part"]), int(row["layer"])) for row in rows])
            layer = np.unique(parts, axis=0, return_inverse=True)[1].ravel() + 1
            width = float(rows[0]["width"])
            setup = path.with_name(f"site-{site}.setup.json")
            if setup.is_file():
                back = np.linalg.inv(np.array(read_json(setup)["transform"], float))
                points = points @ back[:3, :3].T + back[:3, 3]
        except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
            raise InputError(f"{path}: cannot be read as a path: {error}; run the job again") from None
        return WrittenPath(points, on, layer, width)

    @cached_property
    def scan(self) -> LabelledScan | None:
        """The aligned scan; None where the folder has none. Raises InputError for a file that is damaged."""
        path = self.place / "scan.ply"
        if not path.is_file():
            return None
        try:
            head, body = path.read_bytes().split(b"end_header\n", 1)
            words = [line.split() for line in head.decode("ascii").splitlines()]
            (count,) = (int(line[2]) for line in words if line[:2] == ["element", "vertex"])
            dtype = [(line[2], PLY_TYPES[line[1]]) for line in words if line[:1] == ["property"]]
            table = np.frombuffer(body, dtype)
            if len(table) != count:
                raise ValueError(f"{len(table)} of {count} points")
            points = np.stack([table["x"], table["y"], table["z"]], axis=1)
            return LabelledScan(points, table["distance"].astype(np.float64), table["site"])
        except (ValueError, LookupError, TypeError) as error:
            why = shorten_error(error)
            raise InputError(f"{path}: is not as the run wrote it ({why}); run the job again") from None

    def check_site(self, site: int) -> None:
        """Raises InputError where the result has no site of that number."""
        if site and site not in self.site_numbers:
            known = ", ".join(map(str, self.site_numbers)) or "none"
            raise InputError(f"{self.folder}: there is no site {site}; there are: {known}")


def open_output(folder: Path) -> OutputFolder:
    """Reads result.json of an output folder. Raises InputError where it is missing or cannot be read."""
    path = folder / "result.json"
    if not path.is_file():
        raise InputError(
            f"{folder}: there is no result.json, so this is not an output folder; name the folder that `damageest run` "
            "wrote, for example out/<name>",
            code="result_folder",
        )
    try:
        content = read_json(path)
        return OutputFolder(folder, {**content, "sites": list(content["sites"]), "units": content["units"]})
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: cannot be read as a result: {error}; run the job again", code="result_folder"
        ) from None


def _read(path: Path) -> Mesh:
    vertices, faces, _ = read_mesh(path)
    return Mesh(vertices, faces)
