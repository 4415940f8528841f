"""Writes the built-in parts as STEP files, each second one with names and colours of its faces."""

from __future__ import annotations

from pathlib import Path


def write_parts(folder: Path) -> list[Path]:
    """Writes `parts.PARTS` and `more_parts.PARTS` to a folder; gives the files."""
    import cadquery as cq
    from damageest_cadquery.shapes import NamedShape, explore_faces, write_assembly

    from damageest_benchmarks.exact import more_parts, parts

    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number, (name, make) in enumerate({**parts.PARTS, **more_parts.PARTS}.items()):
        path = folder / f"own-{name}.step"
        made = make()
        if number % 2:
            shape = made.val().wrapped
            count = len(explore_faces(shape))
            names = [f"{name} {face}" for face in range(count)]
            colours = [((37 * face) % 256, (91 * face + 60) % 256, 140) for face in range(count)]
            write_assembly(path, name, [NamedShape(name, shape, (150, 150, 150), names, colours)], "mm")
        else:
            cq.exporters.export(made, str(path))
        paths.append(path)
    return paths
