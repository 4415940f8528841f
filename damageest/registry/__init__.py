"""What there is to run: contracts, built-in implementations, plugins, and what is broken among them."""

from damageest.registry.registry import Implementation, Registry

__all__ = ["Implementation", "Registry"]
