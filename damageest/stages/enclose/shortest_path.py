"""Rim to background by shortest paths, and the piece of background that they cut off."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Mesh, Rims, Solid, Surface
from damageest.errors import StageError
from damageest.stages.enclose import Enclose

MARGIN = 0.1
"""Share of the sound points that the two sides must differ by."""
WRONG = 0.03
"""Share of the damage surface that may have the enclosure's inside on the wrong side: a little, where it is creased."""
_INSTEAD = "boundary: all_loops where the damage goes through, another background, or method: implicit"


class ShortestPath(Enclose):
    """Maps each rim node to the nearest background vertex, joins the images by shortest paths, splits the background
    there and sews the damage's side to the rim (paper 3.1 steps 8 to 11). Which side that is, the sound points say."""

    use: Literal["shortest_path"] = "shortest_path"
    overhang: float = Field(
        3.0,
        ge=0,
        le=20,
        description="how far the rim is carried on along the surface, in tolerances",
    )

    def run(
        self, surface: Surface, rims: Rims, background: Solid, intact: Floats, points: Floats, tolerance: float
    ) -> Mesh:
        """Raises StageError where paths do not close, do not split the background, or either side holds sound
        points."""
        from damageest.stages.enclose._sew import carried_on, cut_off, cycle, filled, strip

        wide = carried_on(surface, rims, self.overhang * tolerance)
        cycles = [cycle(background, wide.vertices[loop]) for loop in wide.loops]
        closed = []
        for turned in (True, False):
            start = len(wide.vertices)
            faces = [filled(wide)]
            faces += [strip(loop, round_trip + start, wide.vertices, background.vertices[round_trip])
                      for loop, round_trip in zip(wide.loops, cycles, strict=True)]  # fmt: skip
            body = np.concatenate(faces)
            side = cut_off(background, cycles, against=turned)
            if side is None:
                continue
            body = np.concatenate([body[:, ::-1] if turned else body, side + start])
            closed.append(Mesh(np.concatenate([wide.vertices, background.vertices]), body))
        kept = [_sound_inside(mesh, intact) for mesh in closed]
        if not closed:
            raise StageError("the paths on the background do not split it in two", _INSTEAD)
        best = int(np.argmin(kept))
        if len(closed) > 1 and max(kept) - kept[best] < MARGIN:
            raise StageError(
                f"the sound points do not tell which side is lost: {kept[0]:.0%} and {kept[1]:.0%} of them inside",
                _INSTEAD,
            )
        if kept[best] > 0.02:
            raise StageError(
                f"either side of the damage surface holds sound points ({kept[best]:.0%} at best)", _INSTEAD
            )
        if (wrong := _wrongly_sided(closed[best], len(surface.faces), tolerance)) > WRONG:
            raise StageError(f"the strip to the background runs through {wrong:.0%} of the damage surface", _INSTEAD)
        return closed[best]


def _wrongly_sided(mesh: Mesh, count: int, tolerance: float) -> float:
    """Share of the first ``count`` faces (a thousand of them) that do not have the inside behind and the outside
    before.

    A strip that crosses the surface, or a background cut that folds over, shows there and nowhere else.
    """
    import igl

    chosen = np.unique(np.linspace(0, count - 1, min(count, 1000)).astype(np.int64))
    origin = mesh.vertices.mean(axis=0)
    middle = mesh.triangles[chosen].mean(axis=1) - origin
    step = mesh.cross[chosen]
    step = step * (0.5 * tolerance / np.maximum(np.linalg.norm(step, axis=1), 1e-300))[:, None]
    vertices, faces = np.ascontiguousarray(mesh.vertices - origin), np.array(mesh.faces)
    behind, before = (igl.fast_winding_number(vertices, faces, middle + way * step) for way in (-1, 1))
    right = (np.abs(behind - 1) < 0.5) & (np.abs(before) < 0.5)
    return float(1 - right.mean())


def _sound_inside(mesh: Mesh, intact: Floats) -> float:
    """Share of the sound points (a few thousand of them) inside the mesh; of one turned inside out, outside it."""
    import igl

    few = intact[:: max(1, len(intact) // 4000)]
    if not len(few):
        return 0.0
    origin = few.mean(axis=0)
    number = igl.fast_winding_number(
        np.ascontiguousarray(mesh.vertices - origin), np.array(mesh.faces), np.ascontiguousarray(few - origin)
    )
    return float((number > 0.5).mean())
