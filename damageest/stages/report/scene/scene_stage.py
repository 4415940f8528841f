"""Collects the objects of the 3D view."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.stages.report import _style as style


@dataclass
class Stage:
    """Objects for k3d, in coordinates from ``origin`` that are rounded to ``step``, to be compressed well."""

    origin: Floats
    step: float
    made: list[Any] = field(default_factory=list)
    objects: list[dict[str, Any]] = field(default_factory=list)

    def place(self, points: Floats) -> Any:
        return (np.round((points - self.origin) / self.step) * self.step).astype(np.float32)

    def add(self, item: Any, layer: str, site: int = 0, height: int = 0, alone: bool = False) -> None:
        item.id = len(self.made) + 1  # k3d's own numbers are addresses in memory, and differ from run to run
        self.made.append(item)
        self.objects.append({"id": item.id, "layer": layer, "site": site, "height": height, "alone": alone})

    def add_mesh(
        self, mesh: Mesh, layer: str, colour: str, site: int = 0, opacity: float = 1.0, height: int = 0
    ) -> None:
        import k3d

        if not len(mesh.faces):
            return
        item = k3d.mesh(
            self.place(mesh.vertices),
            mesh.faces.astype(np.uint32),
            color=style.to_number(colour),
            opacity=opacity,
            side="double",
            flat_shading=True,
            name=layer,
        )
        self.add(item, layer, site, height, height > 0)

    def add_points(self, points: Floats, layer: str, site: int, size: float, **look: Any) -> None:
        import k3d

        if len(points):
            self.add(k3d.points(self.place(points), point_size=size, shader="flat", name=layer, **look), layer, site)
