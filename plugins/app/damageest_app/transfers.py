"""Files that the page sends and takes: uploads into the folder, one zip of a result."""

from __future__ import annotations

import os
import re
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damageest.errors import InputError
from damageest_app.folder import Folder
from damageest_app.security import LARGEST_UPLOAD

if TYPE_CHECKING:
    from aiohttp import web

PIECE = 1 << 20


def clean_name(name: str, folder: Folder) -> str:
    """The name under which a dropped file is kept. Raises InputError for a kind of file that no reader takes."""
    plain = re.sub(r"[^\w.+ -]+", "_", Path(name.replace("\\", "/")).name).strip(". ")
    suffix = Path(plain).suffix.lower()
    if not plain or suffix not in {*folder.parts, *folder.scans, ".yaml", ".yml"}:
        known = ", ".join(sorted({*folder.parts, *folder.scans}))
        raise InputError(f"{name}: is no part and no scan; the app takes {known} and job files (.yaml)")
    return plain


def write_zip(folder: Path, target: Any) -> None:
    """Puts the files of an output folder into a zip, without what a run keeps for the next one."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder)
            if path.is_file() and not path.is_symlink() and inside.parts[0] != "stages":
                entry = zipfile.ZipInfo.from_file(path, (Path(folder.name) / inside).as_posix())
                entry.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(entry, path.read_bytes())


def make_routes(folder: Folder, find_output: Any, tell: Any) -> list[Any]:
    """The routes for aiohttp. ``find_output`` gives the output folder of the open job; ``tell`` is called with the name
    of a file that came in."""
    from aiohttp import web

    async def upload(request: web.Request) -> web.Response:
        try:
            name = clean_name(request.query.get("name", ""), folder)
            path = folder.find(name)
            if path.exists():
                raise InputError(f"{name} is there already; give the file another name, or pick the one in the folder")
            await _receive(request, path)
        except InputError as error:
            return web.Response(status=400, text=str(error))
        except OSError as error:
            return web.Response(
                status=507, text=f"the file cannot be written: {error.strerror or error}; free some space"
            )
        tell(name)
        return web.Response(text=name)

    async def download(request: web.Request) -> web.StreamResponse:
        output: Path | None = find_output()
        if output is None or not (output / "result.json").is_file():
            return web.Response(status=404, text="there is no result yet; run the job first")
        import asyncio
        import io

        stream = io.BytesIO()
        await asyncio.to_thread(write_zip, output, stream)
        head = {"Content-Disposition": f'attachment; filename="{output.name}.zip"'}
        return web.Response(body=stream.getvalue(), content_type="application/zip", headers=head)

    return [web.post("/upload", upload), web.get("/download", download)]


async def _receive(request: web.Request, path: Path) -> None:
    """Writes the body of a request to a file; one that is cut off or too large leaves nothing."""
    draft = path.with_name(f".{path.name}.part")
    size = 0
    try:
        with draft.open("wb") as stream:
            async for piece in request.content.iter_chunked(PIECE):
                size += len(piece)
                if size > LARGEST_UPLOAD:
                    raise InputError(f"{path.name} is larger than {LARGEST_UPLOAD // 10**9} GB; copy it to the folder")
                stream.write(piece)
        if not size:
            raise InputError(f"{path.name} is empty")
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)
