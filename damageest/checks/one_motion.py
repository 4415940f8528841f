"""Whether one rigid motion brings the points of a site back onto the skin, as if a view of the scan were misplaced."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Deviation, Ints, Part, Scan

LEAST_SHARE = 0.05
"""Share of the scan's points that a site has at least, for it to be what a view shows."""
ASKED, ROUNDS = 5000, 5
"""Points that are used, and rounds of the robust fit."""
OFF = 1.15
"""Deviation of the points from the skin after the motion, in noises, up to which it explains them."""
LEAST_NOISE = 1 / 6
"""Noise that is reckoned with at least, in tolerances."""
KEPT = 0.9
"""Share of the points that it has to explain."""
TURNED = 0.07
"""How far the normals of the skin below the points span a second direction: the middle eigenvalue of their mean
product. One face that is worn evenly is brought back by a motion as well, and has 0.04 at most; two and more faces, as
a view shows them, have 0.1 and more."""


def is_one_motion(aligned: Scan, deviation: Deviation, part: Part, members: Ints, tolerance: float) -> bool:
    """Whether one motion explains the points ``members`` (M,) of a site, over faces of several directions."""
    if len(members) < LEAST_SHARE * len(aligned.points) or len(members) < 100:
        return False
    some = members[:: max(1, len(members) // ASKED)]
    normals = part.face_normals[deviation.face[some]]
    if np.linalg.eigvalsh(normals.T @ normals / len(some))[1] < TURNED:
        return False
    at = aligned.points[some] - aligned.points[some].mean(axis=0)
    rows = np.concatenate([np.cross(at / np.abs(at).max(), normals), normals], axis=1)
    distance, used = deviation.distance[some], np.ones(len(some), bool)
    scatter = np.inf
    for _ in range(ROUNDS):
        motion = np.linalg.lstsq(rows[used], distance[used], rcond=None)[0]
        left = np.abs(distance - rows @ motion)
        scatter = 1.4826 * float(np.median(left))
        used = left <= 3 * scatter
    noise = max(aligned.noise, LEAST_NOISE * tolerance)
    return scatter < OFF * noise and float(used.mean()) > KEPT
