"""What a kind of trouble is: its scene and its cases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from damageest_benchmarks.troubles.scene import Scanning, TroubleScene


@dataclass(frozen=True)
class TroubleWay:
    """One case of a kind. ``pose``: `known` (align: none) or `unknown`. ``views``: scanner positions; 0: all skin at
    once. ``positions``: whether the job is told the scanner positions. ``amount``: see the kind's function."""

    part: str
    pose: str = "known"
    views: int = 8
    positions: bool = True
    amount: float = 0.0


@dataclass(frozen=True)
class Trouble:
    """A kind of trouble: what makes its scenes, and its cases."""

    make: Callable[[Scanning], TroubleScene]
    ways: tuple[TroubleWay, ...]


def spread_over(parts: str, pose: str = "known", views: int = 8) -> tuple[TroubleWay, ...]:
    """A way for each part. ``pose`` `both`: the poses alternate."""
    poses = {"both": ("known", "unknown")}.get(pose, (pose,))
    return tuple(TroubleWay(name, poses[k % len(poses)], views) for k, name in enumerate(parts.split()))


def spread_amounts(parts: str, amounts: tuple[float, ...]) -> tuple[TroubleWay, ...]:
    """Each part in known pose with each amount, from two positions that the job is not told."""
    return tuple(TroubleWay(name, "known", 2, False, amount) for name in parts.split() for amount in amounts)


_PARTS = ("block", "gear", "tube", "ribbed_plate", "lever", "cuboid", "keyed_shaft", "coupling", "plate", "rib_bracket")


def scan_partly() -> tuple[TroubleWay, ...]:
    """Four parts, each from 1, 3 and 8 positions, in known and in unknown pose."""
    return tuple(
        TroubleWay(name, "known" if (k + views) % 2 else "unknown", views)
        for k, name in enumerate(_PARTS[:4])
        for views in (1, 3, 8)
    )


def scan_from_few(amount: float = 0.0) -> tuple[TroubleWay, ...]:
    """Ten parts, each from 1, 2 and 3 positions, in known and in unknown pose."""
    return tuple(
        TroubleWay(name, "known" if (k + views) % 2 else "unknown", views, amount=amount)
        for k, name in enumerate(_PARTS)
        for views in (1, 2, 3)
    )
