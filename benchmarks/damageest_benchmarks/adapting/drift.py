"""Coherent point drift to compare with (Myronenko and Song, Point set registration, IEEE TPAMI 32, 2010), by pycpd."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats, Part
from damageest.errors import InputError
from damageest.geometry.refinement import cut_part
from damageest.geometry.sampling import sample_by_area
from damageest_benchmarks.adapting.plain import FINE

USED = 2_000
"""Points of part and scan that are registered: the method compares each with each."""
STIFF, WIDE = 2.0, 2.0
"""Weight of the smoothness of the motion, and width of its kernel in standard deviations of the points (defaults)."""
ROUNDS = 100


def fit_by_drift(part: Part, points: Floats) -> Part:
    """The part, deformed by the motion that takes points on it to the points (N,3) of the scan in its frame.

    Raises InputError where pycpd is not installed.
    """
    try:
        from pycpd import DeformableRegistration
    except ImportError:
        raise InputError("coherent point drift needs the library pycpd; pip install pycpd") from None
    rng = np.random.default_rng(0)
    mesh = cut_part(part, part.diagonal / FINE)
    source = sample_by_area(part, USED, rng)[0]
    target = points[rng.permutation(len(points))[:USED]]
    centre, size = source.mean(axis=0), float(source.std())
    found = DeformableRegistration(
        X=(target - centre) / size, Y=(source - centre) / size, alpha=STIFF, beta=WIDE, max_iterations=ROUNDS, w=0.05
    )
    found.register()
    away = ((mesh.vertices - centre) / size)[:, None] - found.Y[None]
    kernel = np.exp(-(away**2).sum(axis=2) / (2 * WIDE**2))
    return replace(mesh, vertices=mesh.vertices + size * kernel @ found.W, cad_scale=0.0)
