"""From where a site is seen best, and small pictures of it, by rays."""

from __future__ import annotations

import base64
import io
from itertools import product
from typing import NamedTuple

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


def draw(view: View, layers: list[tuple[RayCaster, Mesh, str]], size: tuple[int, int], zoom: float = 1.0) -> str:
    """A shaded picture without perspective, as a data URI of a PNG with a transparent background.

    ``layers``: meshes with their rays and colours; of two that lie on each other the later one is seen. ``size``: width
    and height in pixels; the view's radius fills the height at ``zoom`` 1.
    """
    from matplotlib.colors import to_rgb
    from PIL import Image

    width, height = 2 * size[0], 2 * size[1]  # drawn at twice the size, and made smaller, for smooth edges
    right = np.cross(view.up, view.direction)
    right /= np.linalg.norm(right)
    up = np.cross(view.direction, right)
    across, along = np.meshgrid(np.arange(width) - width / 2 + 0.5, height / 2 - 0.5 - np.arange(height))
    pixel = 2 * view.radius / zoom / height
    far = 4 * max(mesh.diagonal for _, mesh, _ in layers) + view.radius
    flat = across.ravel()[:, None] * right + along.ravel()[:, None] * up
    origins = view.centre + far * view.direction + pixel * flat
    ways = np.broadcast_to(-view.direction, origins.shape)
    depth, colour, normal = np.full(len(origins), np.inf), np.zeros((len(origins), 3)), np.zeros((len(origins), 3))
    for rays, mesh, name in layers:
        distance, face = rays.find_first(origins, ways)
        nearer = distance < depth + 1e-4 * view.radius
        depth[nearer], colour[nearer], normal[nearer] = distance[nearer], to_rgb(name), mesh.face_normals[face[nearer]]
    light = view.direction + 0.5 * up - 0.4 * right
    light /= np.linalg.norm(light)
    bright = 0.42 + 0.58 * np.abs(normal @ light)
    seen = np.isfinite(depth).reshape(height, width)
    edge = _find_edges(depth.reshape(height, width), normal.reshape(height, width, 3), pixel)
    image = np.zeros((height, width, 4))
    image[..., :3] = (colour * bright[:, None]).reshape(height, width, 3) * np.where(edge, 0.55, 1.0)[..., None]
    image[..., 3] = seen
    image[..., :3] *= image[..., 3:]
    small = image.reshape(size[1], 2, size[0], 2, 4).mean(axis=(1, 3))
    small[..., :3] /= np.maximum(small[..., 3:], 1e-9)
    stream = io.BytesIO()
    Image.fromarray((np.clip(small, 0, 1) * 255).round().astype(np.uint8), "RGBA").quantize(128, method=2).save(
        stream, "png", optimize=False
    )
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


def _find_edges(depth: Floats, normal: Floats, pixel: float) -> np.ndarray:
    """Whether a pixel is at an edge: the next one to the right or below is much deeper, or turned by more than 40°."""
    edge = np.zeros(depth.shape, bool)
    known = np.where(np.isfinite(depth), depth, depth[np.isfinite(depth)].max(initial=0.0) + 1e6 * pixel)
    for axis in (0, 1):
        ahead = [slice(None)] * 2
        ahead[axis] = slice(1, None)
        back = [slice(None)] * 2
        back[axis] = slice(None, -1)
        step = np.abs(known[tuple(ahead)] - known[tuple(back)]) > 12 * pixel
        turn = np.einsum("ijk,ijk->ij", normal[tuple(ahead)], normal[tuple(back)]) < 0.75
        edge[tuple(back)] |= step | turn
    return edge & np.isfinite(depth)
