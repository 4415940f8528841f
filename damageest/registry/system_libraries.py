"""System libraries that a plugin needs: tried before its package is imported, and named where missing."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping

from damageest.errors import PluginError


def load(library: str) -> None:
    """Loads a shared library into the process. Raises OSError where it is missing."""
    ctypes.CDLL(library)


def can_load(library: str, load: Callable[[str], None] = load) -> bool:
    """Whether a shared library can be loaded; it then is."""
    try:
        load(library)
    except OSError:
        return False
    return True


def require(owner: str, packages: Mapping[str, str], load: Callable[[str], None] = load) -> None:
    """Loads each library; ``packages`` gives the Debian or Ubuntu package that has it.

    Raises PluginError that names what ``owner`` needs, but is missing, and how to install it.
    """
    missing = [library for library in packages if not can_load(library, load)]
    if missing:
        raise PluginError(
            f"{owner} needs {', '.join(missing)} from the system; missing here",
            f"apt-get install {' '.join(dict.fromkeys(packages[library] for library in missing))}, "
            "or the packages that have these files on this system",
        )
