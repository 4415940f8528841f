"""The shared libraries that OpenCASCADE expects from the system."""

from __future__ import annotations

from damageest.registry.system_libraries import load, require

__all__ = ["PACKAGES", "check", "load"]

PACKAGES = {"libGL.so.1": "libgl1", "libX11.so.6": "libx11-6"}
"""Each library and the Debian or Ubuntu package that has it."""


def check() -> None:
    """Raises PluginError that names what OpenCASCADE needs, but is missing, and how to install it."""
    require("CadQuery", PACKAGES, load)
