"""Small pictures of meshes, drawn with rays: they need no graphics library of the system."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.views import View


def draw(view: View, layers: list[tuple[RayCaster, Mesh, str]], size: tuple[int, int], smooth: bool) -> bytes:
    """A shaded picture without perspective, as a PNG with a transparent background.

    ``layers``: meshes with their rays and colours; of two that lie on each other the later one is seen. ``size``: width
    and height in pixels; the view's radius fills the height. ``smooth``: drawn at twice the size and made smaller.
    """
    from PIL import Image

    times = 2 if smooth else 1
    width, height = times * size[0], times * size[1]
    right = np.cross(view.up, view.direction)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(view.direction, right)])
    pixel = 2 * view.radius / height
    across, along = pixel * (np.arange(width) - width / 2 + 0.5), pixel * (height / 2 - 0.5 - np.arange(height))
    start = view.centre + (4 * max(mesh.diagonal for _, mesh, _ in layers) + view.radius) * view.direction
    light = view.direction + 0.5 * frame[1] - 0.4 * right
    light /= np.linalg.norm(light)
    depth = np.full((height, width), np.inf)
    image, shade = np.zeros((height, width, 4), np.float32), np.zeros((height, width), np.float32)
    for rays, mesh, name in layers:
        corners = (mesh.vertices - view.centre) @ frame.T
        columns = np.flatnonzero((across >= corners[:, 0].min()) & (across <= corners[:, 0].max()))
        rows = np.flatnonzero((along >= corners[:, 1].min()) & (along <= corners[:, 1].max()))
        if not len(columns) or not len(rows):
            continue
        box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        places = start + along[box[0], None, None] * frame[1] + across[box[1], None] * right
        ways = np.broadcast_to(-view.direction, places.shape).reshape(-1, 3)
        distance, face = (value.reshape(places.shape[:2]) for value in rays.find_first(places.reshape(-1, 3), ways))
        nearer = distance < depth[box] + 1e-4 * view.radius
        bright = (0.42 + 0.58 * np.abs(mesh.face_normals @ light)).astype(np.float32)[face[nearer]]
        depth[box][nearer], shade[box][nearer] = distance[nearer], bright
        image[box][nearer] = np.append(_read_colour(name), 1)
    image[..., :3] *= (shade * np.where(_find_edges(depth, shade, pixel), 0.55, 1.0))[..., None]
    small = image.reshape(size[1], times, size[0], times, 4).mean(axis=(1, 3))
    small[..., :3] /= np.maximum(small[..., 3:], 1e-9)
    stream = io.BytesIO()
    Image.fromarray((np.clip(small, 0, 1) * 255).round().astype(np.uint8), "RGBA").save(stream, "png", compress_level=6)
    return stream.getvalue()


def _read_colour(name: str) -> Floats:
    """Red, green and blue, 0 to 1, of a colour as #rrggbb."""
    return np.frombuffer(bytes.fromhex(name[1:]), np.uint8) / 255.0


def _find_edges(depth: Floats, shade: Any, pixel: float) -> Any:
    """Whether a pixel is at an edge: the next one to the right or below is much deeper, or of another shade."""
    edge = np.zeros(depth.shape, bool)
    known = np.where(np.isfinite(depth), depth, -1e6 * pixel)
    for ahead, back in ((np.s_[1:, :], np.s_[:-1, :]), (np.s_[:, 1:], np.s_[:, :-1])):
        edge[back] |= (np.abs(known[ahead] - known[back]) > 12 * pixel) | (np.abs(shade[ahead] - shade[back]) > 0.12)
    return edge & np.isfinite(depth)
