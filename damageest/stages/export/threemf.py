"""3MF: one file with all solids, with names, colours and unit.

Written here, not with lib3mf: lib3mf gives other bytes each time (random identifiers), keeps six decimals in every unit
and takes single precision only. The tests read these files with lib3mf and with trimesh.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path

from damageest.geometry.rounding import round_to_single
from damageest.stages.export import Body, ExportedFiles

UNITS = {"um": "micron", "mm": "millimeter", "cm": "centimeter", "m": "meter", "in": "inch", "ft": "foot"}

_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>\n'
)
_RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>\n'
)
_NAMESPACE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"


def write_threemf(folder: Path, stem: str, bodies: Sequence[Body], unit: str) -> ExportedFiles:
    """Writes all bodies as objects of one 3MF file, each with a material of its name and colour, and a build item."""
    from xml.sax.saxutils import quoteattr  # imports urllib and ssl: 0.1 s, that only this format needs

    if not bodies:
        return ExportedFiles()
    materials = "".join(
        f'<base name={quoteattr(body.name)} displaycolor="#{bytes(body.colour).hex().upper()}FF"/>' for body in bodies
    )
    objects = "".join(_build_object(number, quoteattr(body.name), body) for number, body in enumerate(bodies))
    items = "".join(f'<item objectid="{number + 2}"/>' for number in range(len(bodies)))
    model = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="{UNITS[unit]}" xml:lang="en-US" xmlns="{_NAMESPACE}">\n'
        f'<metadata name="Application">damageest</metadata>\n<resources>\n<basematerials id="1">{materials}'
        f"</basematerials>\n{objects}</resources>\n<build>{items}</build>\n</model>\n"
    )
    content = {"[Content_Types].xml": _TYPES, "_rels/.rels": _RELATIONS, "3D/3dmodel.model": model}
    with zipfile.ZipFile(folder / f"{stem}.3mf", "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name, text in content.items():
            entry = zipfile.ZipInfo(name)  # with a fixed date: the same bodies give the same bytes
            entry.compress_type, entry.create_system = zipfile.ZIP_DEFLATED, 3
            archive.writestr(entry, text)
    return ExportedFiles((f"{stem}.3mf",))


def _build_object(number: int, name: str, body: Body) -> str:
    # most readers round to single precision: where the solid stays closed it is rounded here, and nine digits are exact
    single = round_to_single(body.solid)
    mesh, digits = (body.solid, 17) if single is None else (single, 9)
    point = f'<vertex x="{{:.{digits}g}}" y="{{:.{digits}g}}" z="{{:.{digits}g}}"/>\n'.format
    corners = '<triangle v1="{}" v2="{}" v3="{}"/>\n'.format
    vertices = "".join([point(*each) for each in mesh.vertices.tolist()])
    triangles = "".join([corners(*each) for each in mesh.faces.tolist()])
    return (
        f'<object id="{number + 2}" type="model" name={name} pid="1" pindex="{number}">\n<mesh>\n'
        f"<vertices>\n{vertices}</vertices>\n<triangles>\n{triangles}</triangles>\n</mesh>\n</object>\n"
    )
