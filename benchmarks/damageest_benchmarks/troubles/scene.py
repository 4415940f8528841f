"""What a kind of trouble is made from, and what it gives: points with their truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from damageest_evaluate.damages import make_random_damage

from damageest.artefacts import Floats, Ints, Mesh, Part, Solid
from damageest.errors import StageError
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest.geometry.vectors import normalise
from damageest.stages.scan.scanner import apply_tools
from damageest_benchmarks.troubles.parts import NOISE, TOLERANCE, make_named_part
from damageest_benchmarks.troubles.views import measure_seen_share, place_scanners, scan_surface


@dataclass(frozen=True, eq=False)
class TroubleScene:
    """One scan with its truth. Everything is in the part's frame; the case moves it into the scanner's.

    ``part``: what the job is given. ``points`` (N,3), ``view`` (N,) and ``scanners`` (V,3), or None for a scan of all
    skin at once. ``damage``: the true damage. ``seen``: share of the part's skin that the scanner sees. ``added``:
    whether there is metal or other matter outside the nominal surface. ``has_pose``: whether there is a right pose;
    ``shift`` (4,4): the error of the pose that the job is given. ``settings`` of the job. ``deform``: where places
    (N,3) of the part as designed are in the scanned one; None where it is not deformed.
    """

    part: Part
    points: Floats
    damage: Solid | None
    seen: float
    view: Ints | None = None
    scanners: Floats | None = None
    added: bool = False
    has_pose: bool = True
    shift: Floats = field(default_factory=lambda: np.eye(4))
    settings: tuple[str, ...] = ()
    deform: Callable[[Floats], Floats] | None = None

    def with_points(self, points: Floats, keep_views: bool = True) -> TroubleScene:
        """The scene with other points. Points that follow the first N belong to no view."""
        view = self.view
        if view is not None:
            extra = len(points) - len(view)
            view = np.concatenate([view, np.full(extra, -1)]) if extra >= 0 and keep_views else None
        return replace(self, points=points, view=view, scanners=self.scanners if view is not None else None)


@dataclass(frozen=True, eq=False)
class Scanning:
    """How a case is scanned: the part, the number of scanner positions (0: all skin at once), and the random draws.

    ``amount``: the strength of the trouble, as each kind defines it.
    """

    name: str
    seed: int
    views: int = 0
    points: int = 50_000
    amount: float = 0.0
    number: int = 0
    part: Part = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "part", make_named_part(self.name, self.amount))

    @property
    def noise(self) -> float:
        return float(f"{NOISE * self.part.diagonal:.6g}")

    @property
    def tolerance(self) -> float:
        """The tolerance that the job gives."""
        return TOLERANCE * self.noise

    def make_rng(self, purpose: int = 0) -> np.random.Generator:
        """Random draws of this case, others for each ``purpose``."""
        return np.random.default_rng([7919, self.seed, self.number, purpose])

    @property
    def draw_seed(self) -> int:
        return int(self.make_rng(99).integers(1 << 30))

    def scan(
        self, left: Mesh, damage: Solid | None, scanners: Floats | None = None, noise: float = 1.0
    ) -> TroubleScene:
        """The scene of a scan of ``left``, which is all that is there to be seen.

        ``noise``: multiple of the usual one. ``scanners`` (V,3) replace the usual positions.
        """
        rng = self.make_rng()
        if scanners is None and self.views:
            scanners = place_scanners(self.part, self.views, self.make_rng(1))
        points, view = scan_surface(left, scanners, self.points, rng)
        points = points + rng.normal(scale=noise * self.noise, size=points.shape) if noise else points
        seen = measure_seen_share(self.part, left, scanners)
        return TroubleScene(self.part, points, damage, seen, view, scanners)

    def damage(self, kind: str, number: int = 0) -> tuple[Solid, Solid]:
        """What is left of the part after a random damage of a kind, and the damage."""
        found = make_random_damage(self.part, self.draw_seed % 100_000 + number, (kind,), 1)
        return apply_tools(self.part, found.tools)[0], found.damage

    def cut(self, cutter: Any, added: Any = None) -> tuple[Solid, Solid | None]:
        """The part without a Manifold (in the part's frame) and with another one added, and the metal that it lost."""
        body = to_manifold(self.part)
        left = body - cutter if cutter is not None else body
        left = left + added if added is not None else left
        mesh = Solid(*to_arrays(left))
        return mesh, to_solid(_drop_dust(body - left, self.part.volume))


def _drop_dust(body: Any, volume: float) -> Any:
    from manifold3d import Manifold

    return Manifold.compose([piece for piece in body.decompose() if piece.volume() > 1e-9 * volume])


def make_random_waves(size: float, rng: np.random.Generator, count: int = 8) -> tuple[Floats, Floats]:
    """Wave vectors (count,3) with wavelengths near ``size``, and phases (count,)."""
    direction = rng.normal(size=(count, 3))
    direction = normalise(direction)
    return direction * 2 * np.pi / size * rng.uniform(0.8, 1.25, (count, 1)), rng.uniform(0, 2 * np.pi, count)


def evaluate_waves(points: Floats, waves: Floats, phases: Floats) -> Floats:
    """A smooth random field (N,) between -1 and 1 in nearly all places."""
    return np.asarray(np.clip(np.cos(points @ waves.T + phases).mean(axis=1) * np.sqrt(len(waves)) / 1.4, -1, 1))


def require(found: Any, what: str) -> Any:
    """``found``, if there is any. Raises StageError that says that ``what`` is not possible on the part."""
    if found is None:
        raise StageError(f"the part has no place for {what}")
    return found
