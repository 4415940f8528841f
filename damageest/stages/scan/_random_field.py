"""Smooth random fields from a seed: for rough fracture surfaces and for uneven scans."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Mesh
from damageest.geometry.sampling import sample_by_area
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


def choose_patches(mesh: Mesh, share: float, size: float, seed: int) -> Callable[[Floats], NDArray[np.bool_]]:
    """A function of points (N,3) that says which lie in patches, about ``size`` across, which cover this share of the
    surface."""
    field = RandomField.build(2 * size, 1, seed, waves=16)  # half a wavelength is above the mean
    places = sample_by_area(mesh, 20_000, np.random.default_rng([8807, seed]))[0]
    least = float(np.quantile(field.evaluate(places), 1 - share))
    return lambda points: field.evaluate(points) > least
