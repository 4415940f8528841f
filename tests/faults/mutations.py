"""Seeded ways to spoil a file: cut short, bytes changed, pieces moved, counts and values replaced by extreme ones."""

from __future__ import annotations

import io
import random
import re
import struct
import zipfile

KINDS = ("cut", "flip", "splice", "count", "value", "inside")
COUNTS = (-1, 0, 2**31 - 1, 2**32 - 1, 10**9, 10**18, 10**40)
VALUES = ("nan", "1e300", "-1e300", "1e-300", "inf", "1e39", "9e15")
_NUMBER = re.compile(rb"(?<![\w.])-?\d+(\.\d*)?([eE][+-]?\d+)?(?![\w.])")
_YAML = (
    "x: &a [*a]", "a: &a [1,1,1,1,1,1,1,1,1]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b,*b,*b,*b,*b]",
    "<<: *near", "scan: !!python/object:os.system {}", "part: !x box.stl", "output: ~nobody/x", 'part: "bo\\0x.stl"',
    "x: " + "[" * 3000, "tolerance: 1e-300", "tolerance: .nan", "units: !!binary aGk=", "name: ../../x",
    "? [a, b]\n: c", "name: 2020-01-01", "tolerance: " + "9" * 5000, "part: " + "a" * 5000, "output: /proc/x",
    "output: /dev/null",
    "cluster: {neighbours: 1e400}", "sites: {drop: [99999999999999999999]}", "method: [auto]", "scan: [[points.npy]]",
    "%YAML 9.9\n---\n", "---\nversion: 1\n---\nversion: 1", "accept: {1: 2}", "align: {T_part_scan: [[1e300]]}",
)  # fmt: skip


def spoil(data: bytes, name: str, kind: str, rng: random.Random) -> bytes:
    """The file's bytes, spoiled in one way."""
    if kind == "inside":
        return _spoil_inside(data, name, rng)
    return {"cut": _cut, "flip": _flip, "splice": _splice, "count": _count, "value": _value}[kind](data, rng)


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


def _place(data: bytes, rng: random.Random) -> int:
    """A place in the file: half of them in its head, where one byte means most."""
    return rng.randrange(min(len(data), 600) if rng.random() < 0.5 else len(data))


def _flip(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice((1, 2, 8, 30))):
        out[_place(data, rng)] ^= rng.randrange(1, 256)
    return bytes(out)


def _splice(data: bytes, rng: random.Random) -> bytes:
    a, b, to = (_place(data, rng) for _ in range(3))
    piece = data[min(a, b) : max(a, b)][: 1 << rng.randrange(1, 14)]
    return rng.choice((data[:to] + piece + data[to:], data[: min(a, b)] + data[max(a, b) :], data[:to] + piece))


def _is_text(data: bytes) -> bool:
    return b"\0" not in data[:2000]


def _replace_number(data: bytes, rng: random.Random, words: list[bytes], whole: bool) -> bytes:
    found = [m for m in _NUMBER.finditer(data) if not whole or not m.group(1)]
    if not found:
        return _flip(data, rng)
    head = [m for m in found if m.start() < 600]
    out = data
    for match in sorted(rng.sample(found, min(len(found), rng.choice((1, 1, 5)))), key=lambda m: -m.start()):
        out = out[: match.start()] + rng.choice(words) + out[match.end() :]
    if head and rng.random() < 0.6:
        match = rng.choice(head)
        out = data[: match.start()] + rng.choice(words) + data[match.end() :]
    return out


def _count(data: bytes, rng: random.Random) -> bytes:
    if _is_text(data) or (data[:3] == b"ply" and rng.random() < 0.8) or (data[:5] == b"# .PC" and rng.random() < 0.8):
        return _replace_number(data, rng, [str(c).encode() for c in COUNTS], whole=True)
    width = rng.choice((2, 4, 8))
    at = _place(data, rng)
    value = rng.choice(COUNTS) % (1 << 8 * width)
    return data[:at] + value.to_bytes(width, "little") + data[at + width :]


def _value(data: bytes, rng: random.Random) -> bytes:
    if _is_text(data):
        return _replace_number(data, rng, [v.encode() for v in VALUES], whole=False)
    out = data
    for _ in range(rng.choice((1, 3, 20))):
        value = float(rng.choice(VALUES))
        at = rng.randrange(len(out)) & ~3
        raw = struct.pack("<d", value)
        if rng.random() < 0.5:
            raw = struct.pack("<f", value) if abs(value) < 3e38 or value != value else b"\xff\xff\x7f\x7f"
        out = out[:at] + raw + out[at + len(raw) :]
    return out[: len(data)]


def _spoil_inside(data: bytes, name: str, rng: random.Random) -> bytes:
    """Spoils what a container holds, so that the container itself stays sound: the XML of a 3MF, the arrays of a form,
    the pages of an E57, a line of a job."""
    kind = rng.choice(KINDS[:-1])
    if name.endswith((".3mf", ".npz")):
        stream = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as new:
            for one in old.namelist():
                content = old.read(one)
                new.writestr(
                    zipfile.ZipInfo(one), spoil(content, one, kind, rng) if "model" in one or ".npy" in one else content
                )
        return stream.getvalue()
    if name.endswith(".e57"):
        return fix_pages(spoil(data, "", kind, rng))
    if name.endswith(".yaml"):
        lines = data.decode().splitlines()
        word = rng.choice(_YAML)
        key = word.split(":")[0]
        lines = [line for line in lines if not line.startswith(key + ":")] if rng.random() < 0.8 else lines
        lines.insert(rng.randrange(len(lines) + 1), word)
        return "\n".join(lines).encode() + b"\n"
    return _splice(_value(data, rng), rng)


def _make_table() -> list[int]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table


_TABLE = _make_table()


def fix_pages(data: bytes, size: int = 1024) -> bytes:
    """An E57 file with the checksum (CRC-32C) of each page made right again."""
    pages = []
    for start in range(0, len(data) - size + 1, size):
        page, total = data[start : start + size - 4], 0xFFFFFFFF
        for byte in page:
            total = total >> 8 ^ _TABLE[(total ^ byte) & 255]
        pages.append(page + (total ^ 0xFFFFFFFF).to_bytes(4, "big"))
    return b"".join(pages)
