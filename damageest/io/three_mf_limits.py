"""Checks a 3MF file before it is unpacked: sizes, what its XML declares, and how many bodies it stands for."""

from __future__ import annotations

import zipfile
from collections import Counter
from pathlib import Path
from typing import Any

from damageest.errors import InputError

MOST_RATIO = 100
"""Largest ratio of the unpacked size to the file's. XML of meshes has 5 to 20."""
ALWAYS_ALLOWED = 16 * 2**20
"""Bytes that a file may have unpacked whatever the ratio."""
MOST_BODIES = 1000
"""Largest number of bodies, with each object counted as often as it is placed."""


def check_archive(path: Path) -> None:
    """Raises InputError for a file whose content is far larger than the file, that declares XML entities, or whose
    objects are placed too often. Files that are no 3MF in another way are left to the reader."""
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(item.file_size for item in archive.infolist())
            if size > max(ALWAYS_ALLOWED, MOST_RATIO * path.stat().st_size):
                raise InputError(
                    f"{path}: {size / 1e6:.0f} MB are packed into a file of {path.stat().st_size / 1e6:.2g} MB, far "
                    "more than meshes can be packed; export the part again"
                )
            placed: Counter[str] = Counter()
            parts: dict[str, Counter[str]] = {}
            for item in archive.infolist():
                if item.filename.lower().endswith(".model"):
                    _count_bodies(path, archive, item, placed, parts)
    except InputError:
        raise
    except Exception:  # of zipfile, its decompressors and lxml
        return  # the reader says what is wrong
    total = 0
    known: dict[str, int] = {}
    for name, times in placed.items():
        total += times * _count_parts(name, parts, known)
    if total > MOST_BODIES:
        raise InputError(
            f"{path}: its objects stand for more than {MOST_BODIES} bodies; export the part alone, as one solid"
        )


def _count_bodies(
    path: Path, archive: zipfile.ZipFile, item: zipfile.ZipInfo, placed: Counter[str], parts: dict[str, Counter[str]]
) -> None:
    """Adds what a model of the archive places, and what its objects are made of. Raises InputError for entities."""
    from lxml import etree

    with archive.open(item) as stream:
        events: Any = etree.iterparse(
            stream, events=("start", "end"), resolve_entities=False, no_network=True, load_dtd=False, recover=True
        )
        own, is_first = "", True
        for event, element in events:
            if is_first and element.getroottree().docinfo.internalDTD is not None:
                raise InputError(f"{path}: its XML declares entities, which no 3MF does; export the part again")
            is_first = False
            if event == "start":
                word = etree.QName(element).localname if isinstance(element.tag, str) else ""
                if word == "object":
                    own = element.get("id", "")
                    parts.setdefault(own, Counter())
                elif word == "component":
                    parts.setdefault(own, Counter())[element.get("objectid", "")] += 1
                elif word == "item":
                    placed[element.get("objectid", "")] += 1
            else:
                element.clear()
                while element.getprevious() is not None:
                    del element.getparent()[0]


def _count_parts(name: str, parts: dict[str, Counter[str]], known: dict[str, int]) -> int:
    """The bodies that an object stands for; more than is allowed where it contains itself."""
    if name not in known:
        known[name] = MOST_BODIES + 1  # until it is known: what is met again inside itself has no end
        inside = parts.get(name, Counter())
        count = sum(times * _count_parts(one, parts, known) for one, times in inside.items()) if len(known) < 900 else 0
        known[name] = min(max(count, 1), MOST_BODIES + 1)
    return known[name]
