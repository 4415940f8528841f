"""Writes the deposition paths of all sites."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from damageest.artefacts import DepositPath, Floats, Mesh
from damageest.geometry.nozzle import place_tool
from damageest.geometry.solids import concatenate_meshes
from damageest.geometry.transforms import move_mesh, move_points
from damageest.io.meshes import write_ply
from damageest.result import Result
from damageest.stages.export import ExportedFiles, PathSettings, PathWriter, describe_setup


def write_paths(
    result: Result,
    folder: Path,
    place: str,
    T: Floats | None,
    names: Sequence[str],
    writers: Mapping[str, PathWriter],
    settings: PathSettings,
) -> ExportedFiles:
    """Writes each site's path in the formats ``names``, below ``place``. ``settings``: those of the job, to which each
    site adds its title and number.

    ``T`` (4,4) takes a point from the part's frame to that of the files; None for none. A path with a set-up frame is
    written in that frame, and ``site-1.setup.json`` has the transform from the frame of the other files to it. Meshes
    of what no pass reaches, and of nozzle and beam where the nozzle is tightest, are in the frame of the other files.
    What a writer says of a file is a warning, which begins with the file's name.
    """
    files, said = [], []
    for site in result.sites:
        if site.path is None:
            continue
        own = replace(settings, title=f"{result.name} site {site.id}", site=site.id)
        moved = _move_path(site.path, T)
        (folder / f"{place}path").mkdir(parents=True, exist_ok=True)
        for writer in (writers[name] for name in names):
            name = f"{place}path/site-{site.id}.{writer.suffix}"
            said += [f"{name}: {note}" for note in writer.write(folder / name, moved, own) or ()]
            files.append(name)
        if names and moved.setup is not None and describe_setup(moved):
            name = f"{place}path/site-{site.id}.setup.json"
            values = {"units": result.units, "transform": np.add(moved.setup, 0.0).tolist()}
            (folder / name).write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
            files.append(name)
        for kind, mesh in (_list_meshes(site.path) if names else {}).items():
            name = f"{place}path/site-{site.id}.{kind}.ply"
            write_ply(folder / name, move_mesh(mesh, T))
            files.append(name)
    return ExportedFiles(tuple(files), tuple(said), warnings=tuple(said))


def _list_meshes(path: DepositPath) -> dict[str, Mesh]:
    """What is to be seen of a path besides its moves, by the name of its file."""
    found: dict[str, Mesh] = {}
    if path.missing is not None:
        found["unreached"] = path.missing
    if path.tightest is not None:
        tool = [mesh for mesh in place_tool(path, *path.tightest) if len(mesh.faces)]
        found["tool"] = Mesh(*concatenate_meshes(tool)[:2])
    return found


def _move_path(path: DepositPath, T: Floats | None) -> DepositPath:
    """The path moved by a transform (4,4), rigid but for a factor, or into its set-up frame where it has one, as far as
    writers need it."""
    setup = path.setup
    if setup is not None:
        T, setup = setup, setup if T is None else setup @ np.linalg.inv(T)
    if T is None:
        return path
    size = float(np.cbrt(np.linalg.det(T[:3, :3])))
    turn = T[:3, :3].T if abs(size - 1) < 1e-12 else T[:3, :3].T / size
    axes = path.axes @ turn
    if setup is not None:  # without what rounding leaves
        axes = np.where(np.abs(axes - np.round(axes)) < 1e-12, np.round(axes), axes)
    return replace(
        path, points=move_points(path.points, T), axes=axes, normals=path.normals @ turn,
        directions=path.directions @ turn, tightest=None, missing=None, setup=setup,
        around=None if path.around is None else np.append(move_points(path.around[None, :3], T), path.around[3]),
    )  # fmt: skip
