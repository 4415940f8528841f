"""The complement of a part: the space round it, as a solid. Added metal on the part is a loss of its complement.

So what finds losses also finds the volume of added metal.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import ADDED, DAMAGE, OUTLIER, Deviation, Floats, Part, Samples, Sites


def complement_part(part: Part, points: Floats, margin: float) -> Part:
    """A box with the part as its cavity. Part and ``points`` (N,3) are at least ``margin`` away from its sides."""
    low = np.minimum(part.bounds[0], points.min(axis=0, initial=np.inf)) - margin
    high = np.maximum(part.bounds[1], points.max(axis=0, initial=-np.inf)) + margin
    corner = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)], bool)
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    vertices = np.concatenate([part.vertices, np.where(corner, high, low)])
    return Part(vertices, np.concatenate([part.faces[:, ::-1], np.array(faces) + len(part.vertices)]), unit=part.unit)


def complement_deviation(deviation: Deviation) -> Deviation:
    """The deviation of the scan from the part's complement: distances negated, DAMAGE and ADDED exchanged."""
    label = deviation.label.copy()
    label[deviation.label == ADDED] = DAMAGE
    label[deviation.label == DAMAGE] = ADDED
    return Deviation(-deviation.distance, deviation.face, label)


def complement_samples(samples: Samples) -> Samples:
    """The samples of the part's skin as samples of its complement, normals reversed."""
    return replace(samples, normals=-samples.normals)


def label_strays(deviation: Deviation, label: int, kept: Sites) -> Deviation:
    """The deviation with the points of one ``label`` that are in none of the ``kept`` clusters labelled OUTLIER."""
    stray = (deviation.label == label) & (kept.label == 0)
    if not stray.any():
        return deviation
    changed = deviation.label.copy()
    changed[stray] = OUTLIER
    return replace(deviation, label=changed)
