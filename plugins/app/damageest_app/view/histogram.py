"""The histogram of distances to the part, beside the slider of the tolerance."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats

WIDTH, HEIGHT = 360.0, 150.0
BINS = 72


class Histogram:
    """Distances (N,) of a scan to the nominal surface, for any tolerance."""

    def __init__(self, distance: Floats, noise: float, tolerance: float) -> None:
        self.distance = distance[np.isfinite(distance)]
        self.noise = noise
        self.reach = 6 * max(tolerance, 2 * noise, 1e-12)
        self.counts, self.edges = np.histogram(
            np.clip(self.distance, -self.reach, self.reach), BINS, (-self.reach, self.reach)
        )

    @property
    def limits(self) -> tuple[float, float]:
        """Least and largest tolerance of the slider."""
        return max(self.noise, self.reach / 200), self.reach

    def share(self, tolerance: float) -> float:
        """The share of the points that are nearer than the tolerance."""
        return float((np.abs(self.distance) <= tolerance).mean()) if len(self.distance) else 0.0

    def draw(self, tolerance: float, unit: str) -> str:
        """As SVG: the counts on a logarithmic scale, as damage is a small part of a scan."""
        height = np.log1p(self.counts)
        height = height / max(height.max(), 1e-12) * (HEIGHT - 26)
        width = WIDTH / BINS
        bars = {"in": "", "out": ""}
        middle = (self.edges[1:] + self.edges[:-1]) / 2
        for k, tall in enumerate(height):
            key = "in" if abs(middle[k]) <= tolerance else "out"
            bars[key] += f"M{k * width:.1f} {HEIGHT - 18}v{-tall:.1f}h{width - 0.6:.1f}v{tall:.1f}z"
        place = [WIDTH / 2 * (1 + sign * tolerance / self.reach) for sign in (-1, 1)]
        lines = "".join(f'<path class="limit" d="M{x:.1f} 0V{HEIGHT - 18}"/>' for x in place)
        ends = [
            (f"{-self.reach:.3g}", 2, "start"),
            ("0", WIDTH / 2, "middle"),
            (f"{self.reach:.3g} {unit}", WIDTH - 2, "end"),
        ]
        texts = "".join(
            f'<text x="{x:.1f}" y="{HEIGHT - 4}" text-anchor="{anchor}">{text}</text>' for text, x, anchor in ends
        )
        return (
            f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" class="histogram" role="img" aria-label="distances to the part">'
            f'<path class="intact" d="{bars["in"]}"/><path class="off" d="{bars["out"]}"/>{lines}{texts}</svg>'
        )
