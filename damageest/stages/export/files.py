"""The result as files that CAM and inspection programs read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Mesh, Solid
from damageest.meshio import single_precision, write_ply, write_points, write_stl
from damageest.stages.export import Export

if TYPE_CHECKING:
    from damageest.result import Result


class Files(Export):
    """Solids as STL or PLY, inner damage surfaces as PLY, the aligned scan with distance, label and site per point."""

    use: Literal["files"] = "files"
    format: Literal["stl", "ply"] = Field(
        "stl",
        description="of the solids: stl (single precision; a solid that this would open is written as ply too), "
        "or ply (double precision)",
    )

    def run(self, result: Result, folder: Path) -> tuple[str, ...]:
        """Writes into ``folder`` and gives the paths relative to it. The same result gives the same bytes."""
        files: list[str] = []

        def solid(stem: str, body: Solid | None) -> None:
            if body is None:
                return
            (folder / stem).parent.mkdir(parents=True, exist_ok=True)
            single = single_precision(body) if self.format == "stl" else None
            if single is None:
                write_ply(folder / f"{stem}.ply", body)
                files.append(f"{stem}.ply")
            if self.format == "stl":
                write_stl(folder / f"{stem}.stl", single or body)
                files.append(f"{stem}.stl")

        def surface(stem: str, mesh: Mesh) -> None:
            (folder / stem).parent.mkdir(parents=True, exist_ok=True)
            write_ply(folder / f"{stem}.ply", mesh)
            files.append(f"{stem}.ply")

        solid("damage", result.damage)
        solid("undamaged", result.undamaged)
        for site in result.sites:
            solid(f"damage/site-{site.id}", site.damage)
            surface(f"surface/site-{site.id}", site.surface)
            solid(f"deposit/site-{site.id}", site.deposit)
        files.append(_scan(result, folder))
        if result.scan.truth is not None:
            solid("truth/damage", result.scan.truth.damage)
            (folder / "truth").mkdir(exist_ok=True)
            pose = {"units": result.units, "T_part_scan": result.scan.truth.T_part_scan.tolist()}
            (folder / "truth/pose.json").write_text(json.dumps(pose, indent=1) + "\n")
            files.append("truth/pose.json")
        return tuple(files)


def _scan(result: Result, folder: Path) -> str:
    x, y, z = result.aligned.points.T
    columns = {
        "x": x,
        "y": y,
        "z": z,
        "distance": result.deviation.distance.astype(np.float32),
        "label": result.deviation.label.astype(np.uint8),
        "site": result.site_label.astype(np.int32),
    }
    write_points(folder / "scan.ply", columns)
    return "scan.ply"
