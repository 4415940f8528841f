"""Writes the deposition paths of all sites."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from damageest.artefacts import DepositPath, Floats
from damageest.geometry.transforms import move_points
from damageest.result import Result
from damageest.stages.export import ExportedFiles, PathSettings, PathWriter


def write_paths(
    result: Result,
    folder: Path,
    place: str,
    T: Floats | None,
    names: Sequence[str],
    writers: Mapping[str, PathWriter],
    header: str | None,
    footer: str | None,
    options: Mapping[str, str],
) -> ExportedFiles:
    """Writes each site's path in the formats ``names``, below ``place``.

    ``T`` (4,4) takes a point from the part's frame to that of the files; None for none.
    """
    files = []
    for site in result.sites:
        if site.path is None:
            continue
        settings = PathSettings(result.units, f"{result.name} site {site.id}", header, footer, options, site.id)
        for writer in (writers[name] for name in names):
            name = f"{place}path/site-{site.id}.{writer.suffix}"
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            writer.write(folder / name, _move_path(site.path, T), settings)
            files.append(name)
    return ExportedFiles(tuple(files))


def _move_path(path: DepositPath, T: Floats | None) -> DepositPath:
    """The path moved by a rigid transform (4,4), as far as writers need it."""
    if T is None:
        return path
    turn = T[:3, :3].T
    return replace(
        path, points=move_points(path.points, T), axes=path.axes @ turn, normals=path.normals @ turn,
        directions=path.directions @ turn, tightest=None, missing=None,
    )  # fmt: skip
