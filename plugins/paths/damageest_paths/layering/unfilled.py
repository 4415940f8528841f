"""What of a deposit has no bead in layers along a floor: as a body, and its volume by reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from damageest.artefacts import Mesh
from damageest.geometry.solids import to_arrays, to_manifold
from damageest_paths.fill.regions import shift_border
from damageest_paths.sheets.patches import Patch

BESIDE = "lies beside or below the floor that the layers follow, or at a step of theirs"
SLIVER = 0.05
"""Least thickness and volume of what no layer covers, in layer heights and in lengths of bead as long as it is wide."""
GROWN, DEEPER = 0.1, 0.5
"""Shares of a bead's width and height by which layers are taken to be wider and deeper when it is looked for: below a
crease of the floor it is farther than one height to the layer below."""
FIRST = 2.0
"""Layer heights by which the first layer is taken to reach down: to the floor wherever that is."""
DETAIL = 0.01
"""Share of a layer's height within which these bodies are simplified."""
ROUGH = 0.02
"""Share of a bead's width within which the borders of what has no bead are simplified."""


@dataclass(eq=False)
class Unfilled:
    """What is missing of a ``body``, a Manifold, with beads of a ``width`` in layers of a ``height``.

    ``pieces``: it, in pieces that hardly overlap; ``volumes``: theirs by reason; ``covered``: what layers cover.
    """

    body: Any
    width: float
    height: float
    pieces: list[Any] = field(default_factory=list)
    volumes: dict[str, float] = field(default_factory=dict)
    covered: list[Any] = field(default_factory=list)

    @property
    def volume(self) -> float:
        return sum(self.volumes.values())

    def cover(self, patch: Patch, wanted: Any, is_first: bool) -> None:
        """Notes what lies in a layer below the region of a patch that is wanted."""
        wider = shift_border(wanted, GROWN * self.width)
        if not wider.is_empty():
            deep = FIRST if is_first else 1 + DEEPER
            block = patch.fill_below(wider, deep * self.height, self.width / 2)
            self.covered.append(block.simplify(DETAIL * self.height))

    def add_rest(self) -> None:
        """What no layer covers is missing too, as below the planes in which the floor goes on."""
        from manifold3d import Manifold, OpType

        rest = Manifold.batch_boolean([self.body, *self.covered], OpType.Subtract)
        smallest = SLIVER * self.width**2 * self.height
        for piece in rest.decompose():
            # thin skins are where a layer's border is not exact
            if piece.volume() > max(smallest, SLIVER * self.height * piece.surface_area()):
                self._add(piece, {BESIDE: 1.0})

    def add_below(self, patch: Patch, regions: Mapping[str, Any], is_first: bool) -> None:
        """Adds what has no bead in a layer below regions of a patch's plane, by reason."""
        from manifold3d import CrossSection, OpType

        areas = {why: region.area() for why, region in regions.items()}
        whole = CrossSection.batch_boolean(list(regions.values()), OpType.Add).simplify(ROUGH * self.width)
        if whole.is_empty() or sum(areas.values()) <= 0:
            return
        deep = FIRST if is_first else 1.0
        self._add(self.body ^ patch.fill_below(whole, deep * self.height, self.width / 2), areas)

    def _add(self, piece: Any, shares: Mapping[str, float]) -> None:
        """Adds a piece, with its volume by reason in these proportions."""
        if piece.volume() > 0:
            each = piece.volume() / sum(shares.values())
            for why, share in shares.items():
                self.volumes[why] = self.volumes.get(why, 0.0) + each * share
            self.pieces.append(_renew(piece.simplify(DETAIL * self.height)))

    def join(self) -> tuple[Any, dict[str, float]]:
        """All that is missing, as a Manifold, None for nothing; and the volume by reason."""
        from manifold3d import Manifold, OpType

        if not self.pieces:
            return None, {}
        whole = _renew(Manifold.batch_boolean(self.pieces, OpType.Add).simplify(DETAIL * self.height))
        share = whole.volume() / self.volume
        return whole, {why: share * volume for why, volume in self.volumes.items()}


def _renew(body: Any) -> Any:
    """The same solid without what manifold3d knows of the ones that it was made of: unions of solids that nearly
    coincide, made one after the other, take all memory with that (3.5.4)."""
    return to_manifold(Mesh(*to_arrays(body)))
