"""What there is to run: contracts, built-in implementations, plugins, and what is broken among them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damageest.registry.registry import Implementation as Implementation
    from damageest.registry.registry import Registry as Registry

__all__ = ["Implementation", "Registry"]


def __getattr__(name: str) -> Any:
    """Imports the public names when they are first used: the hooks alone need no numpy."""
    if name in __all__:
        from damageest.registry import registry

        return getattr(registry, name)
    raise AttributeError(f"module 'damageest.registry' has no attribute '{name}'")
