"""What there is to run: contracts, built-in implementations, plugins, and what is broken among them."""

# The modules:
# contracts.py, builtins.py: contracts and their defaults; built-in implementations
# registry.py, loading.py, hookspecs.py: what there is, how plugins are loaded, their hooks
# outputs.py: does the output of a stage fit its inputs
# guards.py: the owner of a failing writer
# bundled.py: which package brings what, for messages
# system_libraries.py: missing system libraries

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
