"""Empty spaces that a solid encloses, and that hold no metal: bubbles, which no deposition leaves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from damageest.artefacts import Floats, Solid
from damageest.geometry.bodies import split_shells
from damageest.geometry.solids import subtract_lost, to_arrays, to_manifold

EMPTY = 0.01
"""Share of an enclosed space from which what is empty in it is a bubble: below, metal fills it but for rounding."""


def find_bubbles(body: Solid, metal: Callable[[], Any], part: Solid, origin: Floats) -> list[Any]:
    """The bubbles of ``body`` as Manifolds relative to ``origin`` (3,).

    ``metal`` gives a Manifold of the metal beside it, for example the remaining part. Cavities of the design of
    ``part`` are no bubbles.
    """
    cavities = [cavity for _, inside in split_shells(body) for cavity in inside]
    if not cavities:
        return []
    beside = metal()
    designed = [to_manifold(cavity, origin) for _, inside in split_shells(part) for cavity in inside]
    found = []
    for cavity in cavities:
        space = to_manifold(cavity, origin)
        whole = space.volume()
        for other in (beside, *designed):
            if (space ^ other).volume() > 0:
                space = subtract_lost(space, space ^ other)
        if space.volume() > EMPTY * whole:
            found.append(space)
    return found


def fill_bubbles(body: Any, metal: Any, part: Solid, origin: Floats) -> Any:
    """A Manifold without its bubbles; arguments as of `find_bubbles`, but ``body`` relative to ``origin`` (3,)."""
    for bubble in find_bubbles(Solid(*to_arrays(body, origin)), lambda: metal, part, origin):
        body = body + bubble
    return body
