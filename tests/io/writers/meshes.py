"""Formats of meshes: STL, OBJ, OFF, 3MF, glTF."""

from __future__ import annotations

import base64
import io
import json
import struct
import zipfile

import numpy as np

from tests.io.writers.base import Draw, Rng, Written, box, split


def write_stl(rng: Rng) -> Written:
    draw = Draw(rng)
    corners, faces = box()
    triangles = [[corners[c] for c in part] for face in faces for part in split(face)]
    name = draw.one("name", "", "part", "solid vertex facet", "Å b c", "endsolid")
    if draw.maybe("binary"):
        head = (
            (draw.one("header", "solid ", "", "COLOR=") + name).encode()[:80].ljust(80, draw.one("fill", b"\0", b" "))
        )
        data = head + struct.pack("<I", len(triangles))
        for triangle in triangles:
            data += (
                struct.pack("<3f", *draw.one("normal", (0, 0, 0), (np.nan, 0, 0))) + np.array(triangle, "<f4").tobytes()
            )
            data += struct.pack("<H", draw.one("colour", 0, 0x7FFF))
        data += draw.one("behind", b"", b"", b"\0" * 10)
        return Written({draw.one("suffix", ".stl", ".STL"): data}, corners, draw.ways, ordered=False, area=94.0)
    form = draw.one("numbers", "{:g}", "{:.6e}", "{:+.3E}", "{:.3f}")
    space, indent = draw.one("space", " ", "  ", "\t"), draw.one("indent", "", "  ", "\t")
    solids = draw.one("solids", 1, 1, 2)
    lines = []
    for part in np.array_split(np.array(triangles), solids):
        lines.append(f"solid {name}".rstrip())
        for triangle in part:
            lines += [f"{indent}facet{space}normal 0 0 0", f"{indent * 2}outer{space}loop"]
            lines += [indent * 3 + space.join(["vertex", *map(form.format, corner)]) for corner in triangle]
            lines += [f"{indent * 2}endloop", f"{indent}endfacet"]
        lines.append(draw.one("end", f"endsolid {name}".rstrip(), "endsolid"))
    text = draw.one("end of line", "\n", "\r\n", "\r").join(lines) + draw.one("last", "\n", "", "\n\n")
    text = text.upper() if draw.maybe("capitals", 0.2) else text
    return Written({".stl": text.encode()}, corners, draw.ways, ordered=False, area=94.0)


def write_obj(rng: Rng) -> Written:
    draw = Draw(rng)
    corners, faces = box()
    if draw.maybe("triangles"):
        faces = [part for face in faces for part in split(face)]
    form = draw.one("numbers", "{:g}", "{:.6f}", "{:.5e}")
    more = draw.one("of a vertex", "", "", " 1.0", " 0.5 0.5 0.5")
    space = draw.one("space", " ", "  ", "\t")
    lines = [space.join(["v", *map(form.format, corner)]) + more for corner in corners]
    style = draw.one("corners", "{n}", "{n}/{t}", "{n}//{t}", "{n}/{t}/{t}", "-{b}")
    if "t" in style:
        lines += ["vt 0 0", "vn 0 0 1"]
    for face in faces:
        lines.append(space.join(["f", *(style.format(n=c + 1, t=1, b=8 - c) for c in face)]))
        if draw.maybe("continued", 0.1):
            lines[-1] = lines[-1].replace(space, " \\\n ", 1) if len(space) == 1 else lines[-1]
    for line, share in (
        ("# f 1 2 3 4", 0.4),
        ("g group one", 0.4),
        ("usemtl steel v 1 2 3", 0.3),
        ("s off", 0.3),
        ("", 0.3),
    ):
        if draw.maybe(line, share):
            lines.insert(int(rng.integers(len(lines))), line)
    lines.insert(0, draw.one("first", "# Å", "mtllib part f.mtl", "o part", "   "))
    text = "\n".join(lines) + draw.one("last", "\n", "")
    text = text.replace("\n", draw.one("end of line", "\n", "\n", "\r\n"))
    return Written({".obj": text.encode()}, corners, draw.ways, area=94.0)


def write_off(rng: Rng) -> Written:
    draw = Draw(rng)
    corners, faces = box()
    if draw.maybe("triangles"):
        faces = [part for face in faces for part in split(face)]
    kind = draw.one("kind", "OFF", "OFF", "COFF", "NOFF", "CNOFF", "STOFF", "none", "4OFF", "OFF BINARY")
    tail = {"COFF": " 255 0 0 255", "NOFF": " 0 0 1", "CNOFF": " 0 0 1 255 0 0 255", "STOFF": " 0.5 0.5"}.get(kind, "")
    tail = " 1" if kind == "4OFF" else tail
    head = "" if kind == "none" else kind
    counts = f"8 {len(faces)} {draw.one('edges', 0, 12)}"
    lines = [f"{head} {counts}".strip()] if kind == "none" or draw.maybe("one line", 0.3) else [head, counts]
    form = draw.one("numbers", "{:g}", "{:.6f}", "{:.5e}")
    lines += [" ".join(map(form.format, corner)) + tail for corner in corners]
    colour = draw.one("colour", "", "", " 255 0 0", " 0.5 0.5 0.5 1.0")
    lines += [" ".join(map(str, [len(face), *face])) + colour for face in faces]
    if draw.maybe("blank", 0.3):
        lines.insert(int(rng.integers(1, len(lines))), "")
    if draw.maybe("comment", 0.4):
        lines.insert(int(rng.integers(draw.one("from", 0, 1), len(lines))), "# a comment")
    text = draw.one("end of line", "\n", "\r\n").join(lines) + draw.one("last", "\n", "")
    refused = "OFF" if kind in ("4OFF", "OFF BINARY") else ""
    return Written({".off": text.encode()}, corners, draw.ways, refused=refused, area=94.0)


TYPES = (
    '<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
RELATIONSHIPS = (
    '<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Id="rel0" Target="/{}" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>"
)


def write_3mf(rng: Rng) -> Written:
    draw = Draw(rng)
    corners, faces = box()
    unit = draw.one("unit", "millimeter", "millimeter", "")
    space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    pre = draw.one("prefix", "", "m:")
    vertices = "".join(f'<{pre}vertex x="{x:g}" y="{y:g}" z="{z:g}"/>' for x, y, z in corners)
    triangles = "".join(f'<{pre}triangle v1="{a}" v2="{b}" v3="{c}"/>' for face in faces for a, b, c in split(face))
    turn = draw.one("transform", "", ' transform="0 1 0 -1 0 0 0 0 1 10 20 30"')
    points = corners
    if turn:
        points = np.column_stack([10 - corners[:, 1], 20 + corners[:, 0], 30 + corners[:, 2]])
    mesh = (
        f"<{pre}mesh><{pre}vertices>{vertices}</{pre}vertices><{pre}triangles>{triangles}</{pre}triangles></{pre}mesh>"
    )
    objects = f'<{pre}object id="1" type="model">{mesh}</{pre}object>'
    item = f'<{pre}item objectid="1"{turn}/>'
    if draw.maybe("component"):
        objects += (
            f'<{pre}object id="2" type="model"><{pre}components><{pre}component objectid="1"{turn}/>'
            f"</{pre}components></{pre}object>"
        )
        item = f'<{pre}item objectid="2"/>'
    declared = f'xmlns{":m" if pre else ""}="{space}"'
    said = f' unit="{unit}"' if unit else ""
    model = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<{pre}model{said} xml:lang="en-US" {declared}>'
        f'<{pre}metadata name="Title">Å</{pre}metadata>'
        f"<{pre}resources>{objects}</{pre}resources><{pre}build>{item}</{pre}build></{pre}model>"
    )
    place = draw.one("place", "3D/3dmodel.model", "3D/other.model")
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", draw.one("packed", zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)) as archive:
        archive.writestr("[Content_Types].xml", TYPES)
        archive.writestr("_rels/.rels", RELATIONSHIPS.format(place))
        archive.writestr(place, model)
    return Written({".3mf": stream.getvalue()}, points, draw.ways, ordered=False, area=94.0)


def write_gltf(rng: Rng) -> Written:
    draw = Draw(rng)
    corners, faces = box()
    triangles = np.array([part for face in faces for part in split(face)])
    wide = draw.maybe("stride")
    row = np.zeros((8, 5 if wide else 3), "<f4")
    row[:, :3] = corners
    kind, code = draw.one("indices", ("<u2", 5123), ("<u4", 5125), ("u1", 5121))
    lead = draw.one("in front", 0, 8)
    indices = triangles.astype(kind).tobytes()
    blob = b"\0" * lead + row.tobytes() + indices
    blob += b"\0" * (-len(blob) % 4)
    view = {"buffer": 0, "byteOffset": lead, "byteLength": row.nbytes, **({"byteStride": 20} if wide else {})}
    views = [view, {"buffer": 0, "byteOffset": lead + row.nbytes, "byteLength": len(indices)}]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [3, 4, 5]},
        {"bufferView": 1, "componentType": code, "count": 36, "type": "SCALAR"},
    ]
    primitive = {"attributes": {"POSITION": 0}, **({"indices": 1} if draw.maybe("indexed", 0.8) else {"mode": 0})}
    moved = draw.one("moved", "no", "matrix", "parts", "parent")
    node: dict = {"mesh": 0}
    points = corners
    if moved == "matrix":
        node["matrix"] = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]
    elif moved == "parts":
        node |= {"translation": [1, 2, 3], "rotation": [0, 0, 0.5**0.5, 0.5**0.5]}
    nodes = [node]
    if moved == "parent":
        nodes = [{"children": [1], "translation": [1, 2, 3]}, {"mesh": 0, "rotation": [0, 0, 0.5**0.5, 0.5**0.5]}]
    if moved != "no":
        points = np.column_stack([1 - corners[:, 1], 2 + corners[:, 0], 3 + corners[:, 2]])
    tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
            "meshes": [{"primitives": [primitive]}], "accessors": accessors, "bufferViews": views,
            "buffers": [{"byteLength": len(blob)}]}  # fmt: skip
    form = draw.one("form", "glb", "embedded", "beside")
    if form == "glb":
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        data = struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(blob))
        data += struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
        return Written({".glb": data}, points, draw.ways, ordered=False, error=1e-5)
    uri = (
        "scan%20data.bin"
        if form == "beside"
        else "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
    )
    tree["buffers"][0]["uri"] = uri
    files = {".gltf": json.dumps(tree, indent=draw.one("lines", None, 2)).encode()}
    if form == "beside":
        files["scan data.bin"] = blob
    refused = "in another file" if form == "beside" else ""
    return Written(files, points, draw.ways, ordered=False, error=1e-5, refused=refused)
