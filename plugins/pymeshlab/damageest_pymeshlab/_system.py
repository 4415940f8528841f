"""The shared libraries that PyMeshLab expects from the system."""

from __future__ import annotations

import ctypes

from damageest.errors import PluginError

PACKAGES = {
    "libGL.so.1": "libgl1",
    "libOpenGL.so.0": "libopengl0",
    "libgmp.so.10": "libgmp10",
    "libcom_err.so.2": "libcom-err2",
}
"""Each library and the Debian or Ubuntu package that has it."""


def load(library: str) -> None:
    """Loads a shared library into the process. Raises OSError where it is not there."""
    ctypes.CDLL(library)


def check() -> None:
    """Raises PluginError that names what PyMeshLab needs, but is missing, and how to install it."""
    missing = [library for library in PACKAGES if not _loads(library)]
    if missing:
        raise PluginError(
            f"PyMeshLab needs {', '.join(missing)} from the system, and does not find it here",
            f"apt-get install {' '.join(PACKAGES[library] for library in missing)}, "
            "or the packages that have these files on this system",
        )


def _loads(library: str) -> bool:
    try:
        load(library)
    except OSError:
        return False
    return True
