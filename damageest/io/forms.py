"""The form of a measured part in a file: how it differs from the part as designed, and where that was seen."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from damageest.artefacts import ArtefactError, DisplacementField, Floats, Part, Scan, fit_scattered
from damageest.errors import InputError, describe_error
from damageest.geometry.families import Family, build_family
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.transforms import find_nearest_motion, move_points
from damageest.io.digests import digest
from damageest.io.files import check_file, file_sha256

FORM = "adapt.npz"
"""Name of the file in an output folder."""
VERSION = 1
MOST_BYTES = 64 * 2**20
"""Size of the arrays of a file, unpacked, that are read; a run writes less than a hundredth of it."""
PLACES = 1500
"""Places on the skin by which parts of a type are compared."""
SMALL = 0.05
"""Difference between parts that does not matter, in tolerances."""
SMOOTH = 1e-6
"""Weight of the third differences of a lattice that is fitted to places on skin."""
MARKS = 24
"""Points of a scan by whose distances it is known again in any frame."""
SAME = 1e-6
"""Relative difference of such distances in the same scan."""
AGAIN = "run the job that wrote it again"


@dataclass(frozen=True, eq=False)
class MeasuredForm:
    """A measured part of a type. ``field``: its displacement, in ``unit``, for places of the part as designed, whose
    hashes are ``part``: of its file and of its mesh. ``seen`` (S,3): places of its skin where intact skin was scanned;
    skin within ``reach`` of one of them was seen; ``left`` (S,): how far it lies outside the field's there.
    ``tolerance``: that of the run. ``scan``: hashes of the scan's files; ``marks``: distances between some of its
    points. ``path``: where it was read from."""

    field: DisplacementField
    seen: Floats
    left: Floats
    reach: float
    unit: str
    tolerance: float
    part: tuple[str, ...]
    scan: tuple[str, ...] = ()
    marks: tuple[float, ...] = ()
    path: str = ""

    def is_of(self, scan: Scan) -> bool:
        """Whether it was measured by this scan."""
        own = hash_scan(scan)
        if self.scan and own:
            return bool(set(self.scan) & set(own))
        marks = mark_scan(scan)
        return len(marks) == len(self.marks) > 0 and bool(np.allclose(marks, self.marks, rtol=SAME, atol=0))


def identify_part(part: Part) -> tuple[str, ...]:
    """Hashes that name a part as designed: of its file, where it has one, and of its mesh."""
    return tuple(text for text in (part.sha256, digest(part.vertices, part.faces)) if text)


def hash_scan(scan: Scan) -> tuple[str, ...]:
    """Hashes of the files of a scan; none where it was arrays or its files are gone."""
    return tuple(file_sha256(Path(path)) for path in scan.paths if Path(path).is_file())


def mark_scan(scan: Scan) -> tuple[float, ...]:
    """Distances between points of a scan, which are the same in any frame."""
    if not len(scan.points):
        return ()
    some = scan.points[np.linspace(0, len(scan.points) - 1, MARKS).astype(np.int64)]
    return tuple(np.linalg.norm(np.diff(some, axis=0), axis=1).tolist())


def write_form(path: Path, form: MeasuredForm) -> None:
    """Writes a form as .npz, without pickle. The same form gives the same bytes. Raises OSError."""
    field = form.field
    arrays: dict[str, Any] = {
        "version": VERSION,
        "unit": form.unit,
        "low": field.low,
        "high": field.high,
        "controls": field.controls,
        "seen": form.seen.astype(np.float32),
        "left": form.left.astype(np.float32),
        "reach": form.reach,
        "tolerance": form.tolerance,
        "part": np.array(form.part, dtype="U64"),
        "scan": np.array(form.scan, dtype="U64"),
        "marks": np.array(form.marks),
    }
    with path.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def read_form(path: Path) -> MeasuredForm:
    """Reads a form. Raises InputError, which names the file, for one that is missing, damaged or of another kind."""
    check_file(path, (".npz",), "the form of a measured part")
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(item.file_size for item in archive.infolist())
        if size > MOST_BYTES:
            raise InputError(f"{path}: holds {size / 1e6:.0f} MB of arrays, which no form of a part has; {AGAIN}")
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        version = int(arrays["version"])
        if version != VERSION:
            raise InputError(f"{path}: has version {version}, and this program reads {VERSION}; {AGAIN}")
        field = DisplacementField(arrays["low"], arrays["high"], arrays["controls"])
        seen, reach, tolerance = np.asarray(arrays["seen"], float), float(arrays["reach"]), float(arrays["tolerance"])
        left = np.asarray(arrays["left"], float)
        if seen.ndim != 2 or seen.shape[1] != 3 or left.shape != seen.shape[:1]:
            raise ValueError("the places that were seen are no points")
        if not np.isfinite([*seen.ravel(), *left, reach, tolerance]).all():
            raise ValueError("some of its numbers are not finite")
        return MeasuredForm(
            field, seen, left, reach, str(arrays["unit"]), tolerance, _read_texts(arrays["part"]),
            _read_texts(arrays["scan"]), tuple(np.asarray(arrays["marks"], float).ravel().tolist()), str(path),
        )  # fmt: skip
    except (OSError, EOFError, ValueError, LookupError, TypeError, ArtefactError, zipfile.BadZipFile, zlib.error,
            NotImplementedError, MemoryError, SyntaxError, TokenError) as error:  # fmt: skip
        why = describe_error(error, 120)
        raise InputError(f"{path}: is no form of a measured part, or damaged ({why}); {AGAIN}") from None


def require_type(forms: Sequence[MeasuredForm], part: Part) -> None:
    """Raises InputError for a form of another part, or in another unit."""
    own = set(identify_part(part))
    for form in forms:
        if form.unit != part.unit:
            raise InputError(
                f"{form.path}: its lengths are in {form.unit}, those of this job in {part.unit}; give only parts that "
                "were measured in the same unit"
            )
        if not own & set(form.part):
            raise InputError(
                f"{form.path}: is the form of another part: its CAD file differs from {part.path or 'that of this job'}"
                "; give only parts of the same type, measured against the same file"
            )


def gather_family(forms: Sequence[MeasuredForm], part: Part, error: float) -> tuple[Family, Floats]:
    """The forms of a type at places on the skin of the part as designed, about the centre of its box; and the normals
    (N,3) there. ``error``: deviation of a place that does not matter."""
    from scipy.spatial import cKDTree

    centre = part.bounds.mean(axis=0)
    places, face = sample_by_area(part, PLACES, np.random.default_rng(7))
    moved = np.stack([form.field.move(places) - centre for form in forms])
    apart = 2 * float(np.sqrt(part.area / PLACES))
    seen = np.zeros(moved.shape[:2], bool)
    normals = part.face_normals[face]
    for k, form in enumerate(forms):
        if not len(form.seen):
            continue
        distance, near = cKDTree(form.seen).query(places)
        seen[k] = distance <= max(form.reach, apart)
        moved[k, seen[k]] += (form.left[near, None] * normals)[seen[k]]  # what its field did not follow
    return build_family(places - centre, moved, seen, error), normals


def average_forms(forms: Sequence[MeasuredForm], part: Part) -> tuple[MeasuredForm, float]:
    """The mean of forms of a type, without a rigid motion, and the share of the skin that was seen on one of them."""
    error = SMALL * min(form.tolerance for form in forms)
    family, _ = gather_family(forms, part, error)
    centre = part.bounds.mean(axis=0)
    seen = family.count > 0
    used = seen if seen.any() else ~seen
    mean = move_points(family.mean, find_nearest_motion(family.mean, family.places, used.astype(float)))
    cells = np.max([form.field.cells for form in forms], axis=0).tolist()
    low, high = part.bounds
    field = fit_scattered(family.places + centre, mean - family.places, low, high, cells, SMOOTH)
    places = family.places[seen] + centre
    reach = 2 * float(np.sqrt(part.area / PLACES))
    return MeasuredForm(
        field, places, np.zeros(len(places)), reach, part.unit, forms[0].tolerance, identify_part(part)
    ), float(seen.mean())


def _read_texts(array: Any) -> tuple[str, ...]:
    return tuple(str(text) for text in np.asarray(array).ravel().tolist())
