"""How a picture or a window fails, in words: no OpenGL, a package that is not installed, or what else it was."""

from __future__ import annotations

import re

from damageest.errors import (
    DamageestError,
    StageError,
    clean_message,
    describe_missing_library,
    describe_shortage,
    find_missing_library,
)
from damageest.isolation import ProcessError

INSTALL_GRAPHICS = (
    "apt-get install libegl1 libgl1 libgl1-mesa-dri (OpenGL without a graphics card); or open report.html in a "
    "browser: its pictures need none"
)
GRAPHICS = re.compile(r"OpenGL|\bE?GLX?\b|OSMesa|X server|RenderWindow", re.IGNORECASE)
"""Words of VTK's and PyVista's messages where they found no OpenGL."""
GRAPHICS_LIBRARY = re.compile(r"lib(GL|EGL|GLX|OpenGL|OSMesa|GLdispatch)\b")
"""Shared libraries of OpenGL."""


def describe_failure(error: Exception, what: str = "the picture could not be drawn") -> Exception:
    """The error for the user; it names OpenGL only where that is missing, or likely to be."""
    if GRAPHICS_LIBRARY.match(find_missing_library(error)):
        return StageError(f"{what}: this machine has no OpenGL ({error})", INSTALL_GRAPHICS, code="missing")
    if isinstance(error, ProcessError) and error.why == "crash" and "SIGKILL" not in error.message:
        text = f"{what}: {error.message}, as on a machine without OpenGL or with a failing graphics driver"
        return StageError(text, INSTALL_GRAPHICS, code="missing")
    if isinstance(error, DamageestError):
        return error
    if known := describe_missing_library(error) or describe_shortage(error):
        return known
    if isinstance(error, OSError):
        return error
    text = f"{type(error).__name__}: {clean_message(error, 400)}"
    if GRAPHICS.search(str(error)):
        text = f"{what}: this machine has no OpenGL, or its graphics driver failed ({text})"
        return StageError(text, INSTALL_GRAPHICS, code="missing")
    return StageError(f"{what}: {text}", "--debug shows where; report.html has pictures of its own", code="faulty")
