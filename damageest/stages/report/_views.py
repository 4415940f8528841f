"""From where a site is seen best, and small pictures of it, by rays."""

from __future__ import annotations

import base64
import io
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.rays import RayCaster

DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
PROBES = 150
"""Points of a damage surface that are asked for from where they are seen."""


class View(NamedTuple):
    """A place to look at: ``centre`` (3,), ``radius`` of what is to be seen, ``direction`` (3,) from there to the eye,
    and ``up`` (3,)."""

    centre: Floats
    radius: float
    direction: Floats
    up: Floats


def choose_view(left: RayCaster, surface: Mesh, bounds: Floats, scale: float) -> View:
    """From where most of a damage ``surface`` is seen past what is ``left`` of the part, rather from above and askew.

    ``bounds`` (2,3) of the damage; ``scale``: a length of which a thousandth is small.
    """
    centre, radius = bounds.mean(axis=0), float(np.linalg.norm(np.ptp(bounds, axis=0)) / 2)
    slope = -DIRECTIONS @ np.array([1.0, 1.0, -1.0]) / np.sqrt(3)  # highest from the front, the left and above
    score = 0.1 * slope
    if len(surface.faces):
        every = max(len(surface.faces) // PROBES, 1)
        normals = surface.face_normals[::every]
        places = surface.triangles[::every].mean(axis=1) + 1e-3 * scale * normals
        starts = np.repeat(places, len(DIRECTIONS), axis=0)
        ways = np.tile(DIRECTIONS, (len(places), 1))
        free = np.isinf(left.find_first(starts, ways)[0]).reshape(len(places), -1)
        facing = np.clip(normals @ DIRECTIONS.T, 0, None)
        score = score + (free * (0.4 + 0.6 * facing)).mean(axis=0)
    direction = DIRECTIONS[int(score.argmax())]
    up = np.array([0.0, 1.0, 0.0]) if abs(direction[2]) > 0.99 else np.array([0.0, 0.0, 1.0])
    return View(centre, max(radius, 1e-3 * scale), direction, up)


def draw(view: View, layers: list[tuple[RayCaster, Mesh, str]], size: tuple[int, int], smooth: bool) -> str:
    """A shaded picture without perspective, as a data URI of a PNG with a transparent background.

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
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


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
