"""What the packages of this project bring, so that a message can name the one that is missing.

Only messages use this: what can be run is what was found, whoever provides it.
"""

from __future__ import annotations

COMMANDS = {"app": "damageest-app", "evaluate": "damageest-evaluate", "machine": "damageest-machines"}
"""Command to package."""

CONVERSIONS = {"cadquery": "damageest-cadquery"}
"""Kind of object that a result can be converted to, to package."""

FORMATS = {"step": "damageest-cadquery", "qif": "damageest-qif"}
"""Format that `export` writes, to package."""

PATH_FORMATS = dict.fromkeys(
    ("krl", "rapid", "fanuc", "sinumerik", "heidenhain", "linuxcnc", "json"), "damageest-machines"
)
"""Format of deposition paths that `export` writes, to package."""

IMPLEMENTATIONS = {
    ("part", "brep"): "damageest-cadquery",
    ("reconstruct", "ball_pivot"): "damageest-open3d",
    ("reconstruct", "pymeshlab"): "damageest-pymeshlab",
    ("enclose", "octree"): "damageest-octree",
    ("enclose", "poisson_subtract"): "damageest-open3d",
    ("enclose", "sweep"): "damageest-sweep",
    ("repair", "pymeshfix"): "damageest-pymeshfix",
    ("boolean", "pymeshlab"): "damageest-pymeshlab",
    ("path", "layers"): "damageest-paths",
}
"""Stage and name to package."""

METHODS = {"octree": "damageest-octree"}
"""Value of a job's `method` to package."""

SUFFIXES = dict.fromkeys((".step", ".stp", ".iges", ".igs", ".brep"), "damageest-cadquery")
"""Suffix of a part's file to package."""

PACKAGES = {
    package
    for brought in (COMMANDS, CONVERSIONS, FORMATS, PATH_FORMATS, IMPLEMENTATIONS, METHODS, SUFFIXES)
    for package in brought.values()
}
"""All of them."""
