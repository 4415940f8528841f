"""Smooth random fields from a seed: for rough fracture surfaces and for uneven scans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise


@dataclass(frozen=True, eq=False)
class RandomField:
    """A sum of cosines of random direction and phase; standard deviation about 1, clipped to -2.5 to 2.5."""

    waves: Floats
    phases: Floats
    heights: Floats

    @classmethod
    def build(cls, wavelength: float, octaves: int, seed: int, waves: int = 10) -> RandomField:
        """``octaves`` bands of ``waves`` cosines each; each band has half the wavelength and half the height of the one
        before."""
        rng = np.random.default_rng([20771, seed])
        band = np.repeat(np.arange(octaves), waves)
        direction = rng.normal(size=(len(band), 3))
        direction = normalise(direction)
        heights = np.asarray(0.5**band, dtype=np.float64)
        heights /= np.sqrt((heights**2).sum() / 2)
        number = 2 * np.pi / wavelength * 2.0**band * rng.uniform(0.8, 1.25, len(band))
        return cls(direction * number[:, None], rng.uniform(0, 2 * np.pi, len(band)), heights)

    def evaluate(self, points: Floats) -> Floats:
        """The field (N,) at points (N,3)."""
        total = np.zeros(len(points))
        for wave, phase, height in zip(self.waves, self.phases, self.heights, strict=True):
            total += height * np.cos(points @ wave + phase)
        return np.clip(total, -2.5, 2.5)
