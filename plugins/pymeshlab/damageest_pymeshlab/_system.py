"""The shared libraries that PyMeshLab expects from the system."""

from __future__ import annotations

from damageest.registry.system_libraries import load, require

__all__ = ["PACKAGES", "check", "load"]

PACKAGES = {
    "libGL.so.1": "libgl1",
    "libOpenGL.so.0": "libopengl0",
    "libgmp.so.10": "libgmp10",
    "libcom_err.so.2": "libcom-err2",
}
"""Each library and the Debian or Ubuntu package that has it."""


def check() -> None:
    """Raises PluginError that names what PyMeshLab needs, but is missing, and how to install it."""
    require("PyMeshLab", PACKAGES, load)
