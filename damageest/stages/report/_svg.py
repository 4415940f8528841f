"""Drawings as SVG, in the colours of the page. Its own, since to import a library for plots takes a tenth of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from damageest.artefacts import Floats
from damageest.io.section_files import round_nice

INK, SOFT, GROUND, METAL = "var(--ink)", "var(--soft)", "var(--ground)", "var(--metal)"
"""Colours that the page's style sheet gives, for a light and a dark ground."""
NO_FILL = "fill:none"


class Drawing:
    """An SVG element of ``width`` by ``height`` pixels in which everything drawn has a name; ids begin with ``name``.

    ``low``, ``high`` (2,): the corners of what is drawn, in its own unit, y upwards; they lie ``margins`` (left,
    bottom, right, top), in pixels, from the edges of the element.
    """

    def __init__(
        self,
        name: str,
        width: float,
        height: float,
        low: Sequence[float] | Floats,
        high: Sequence[float] | Floats,
        margins: Sequence[float] = (0, 0, 0, 0),
    ) -> None:
        left, bottom, right, top = margins
        self.name, self.width, self.height = name, width, height
        self.low = np.asarray(low, float)
        self.scale = np.array([width - left - right, height - bottom - top]) / (np.asarray(high, float) - self.low)
        self._corner = np.array([left, height - bottom])
        self._clip = (left, top, width - left - right, height - bottom - top)
        self._parts: list[str] = []

    def place(self, points: Floats) -> Floats:
        """Points (N,2) of the drawing in pixels (N,2) from the top left of the element."""
        moved = (np.atleast_2d(points) - self.low) * self.scale
        return np.column_stack([self._corner[0] + moved[:, 0], self._corner[1] - moved[:, 1]])

    def fill(self, label: str, loops: Iterable[Floats], style: str) -> None:
        """Closed outlines (N,2) as one shape, with holes where they lie in each other."""
        text = " ".join(f"M{self._join(loop)}Z" for loop in loops if len(loop))
        if text:
            self._add(label, f'<path d="{text}" style="fill-rule:evenodd;{style}"/>')

    def draw_lines(self, label: str, points: Floats, style: str) -> None:
        """A line through points (N,2), broken where they are NaN."""
        cuts = np.flatnonzero(np.isnan(points).any(axis=1))
        pieces = np.split(points, cuts)
        text = " ".join(
            f"M{self._join(piece)}" for piece in (p[~np.isnan(p).any(axis=1)] for p in pieces) if len(piece)
        )
        if text:
            self._add(label, f'<path d="{text}" style="{NO_FILL};{style}"/>')

    def draw_points(self, label: str, points: Floats, radius: float, style: str) -> None:
        """A disc of a radius in pixels at each of the points (N,2)."""
        if not len(points):
            return
        mark = f"{self.name}-{label}-mark"
        used = "".join(f'<use href="#{mark}" x="{x:.2f}" y="{y:.2f}"/>' for x, y in self.place(points))
        self._add(label, f'<defs><circle id="{mark}" r="{radius}"/></defs><g style="{style}">{used}</g>')

    def write(self, words: str, at: Floats | Sequence[float], shift: Sequence[float], style: str) -> None:
        """Words at a point (2,) of the drawing, moved by ``shift`` pixels to the right and down."""
        x, y = self.place(np.asarray(at, float))[0] + np.asarray(shift, float)
        self._parts.append(f'<text x="{x:.2f}" y="{y:.2f}" style="{style}">{escape(words)}</text>')

    def turn_to_side(self, words: str, style: str) -> None:
        """Words along the left edge, read from below."""
        y = self._clip[1] + self._clip[3] / 2
        turn = f"translate(12 {y:.1f}) rotate(-90)"
        self._parts.append(f'<text transform="{turn}" style="{style}">{escape(words)}</text>')

    def draw_tick(self, at: Floats | Sequence[float], end: Sequence[float], style: str) -> None:
        """A short line from a point (2,) of the drawing to where ``end`` pixels to the right and down lead."""
        x, y = self.place(np.asarray(at, float))[0]
        self._parts.append(f'<path d="M{x:.2f} {y:.2f}l{end[0]} {end[1]}" style="{style}"/>')

    def to_svg(self) -> str:
        """The element as text."""
        x, y, width, height = self._clip
        clip = f'<clipPath id="{self.name}-clip"><rect x="{x}" y="{y}" width="{width}" height="{height}"/></clipPath>'
        start = f'<svg viewBox="0 0 {self.width:g} {self.height:g}" aria-hidden="true"><defs>{clip}</defs>'
        return f"{start}{''.join(self._parts)}</svg>"

    def _add(self, label: str, content: str) -> None:
        own = quoteattr(f"{self.name}-{label}")
        self._parts.append(f'<g id={own} clip-path="url(#{self.name}-clip)">{content}</g>')

    def _join(self, points: Floats) -> str:
        return " ".join(f"{x:.2f} {y:.2f}" for x, y in self.place(points))


def choose_ticks(low: float, high: float, count: int) -> Floats:
    """Round values between two limits: about ``count`` of them, at multiples of 1, 2 or 5 times a power of ten."""
    step = round_nice((high - low) / max(count, 1))
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    return np.asarray(np.arange(first, last + 1) * step, np.float64)
