"""Figures of the examples: panels side by side, written to docs/figures as small PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from examples.coons import Patch

FOLDER = Path(__file__).parents[1] / "docs" / "figures"
GAP = 8
SMOOTHING = 3
"""Line drawings are drawn this much larger and averaged down."""

PAPER, EDGE, FOLDED, OUTLINE = (255, 255, 255), (150, 165, 185), (226, 74, 51), (20, 40, 90)

Panel = NDArray[np.uint8]


def save(name: str, rows: Sequence[Sequence[Panel]], step: int = 1) -> Path:
    """Write rows of panels `(h, w, 3)` as one picture, colours rounded to multiples of `step`."""
    lines = [_beside(row) for row in rows]
    width = max(line.shape[1] for line in lines)
    stacked = [np.pad(x, ((0, GAP), (0, width - x.shape[1]), (0, 0)), constant_values=255) for x in lines]
    picture = np.concatenate(stacked)[:-GAP].astype(np.int64)
    rounded = np.minimum((picture + step // 2) // step * step, 255).astype(np.uint8)
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.png"
    Image.fromarray(rounded).save(path, optimize=True)
    return path


def _beside(row: Sequence[Panel]) -> Panel:
    height = max(panel.shape[0] for panel in row)
    padded = [np.pad(p, ((0, height - p.shape[0]), (0, GAP), (0, 0)), constant_values=255) for p in row]
    return np.concatenate(padded, axis=1)[:, :-GAP]


def mesh_panels(patch: Patch, size: int = 220) -> list[Panel]:
    """The domain's mesh and its image, folded triangles in red."""
    return [_mesh(vertices, patch, size) for vertices in (patch.domain, patch.image)]


def _mesh(vertices: NDArray[np.float64], patch: Patch, size: int) -> Panel:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    scale = (size - 2 * GAP) / (high - low).max()
    at = ((vertices - (low + high) / 2) * scale + size / 2) * SMOOTHING
    picture = Image.new("RGB", (size * SMOOTHING, size * SMOOTHING), PAPER)
    pen = ImageDraw.Draw(picture)
    order = np.argsort(patch.flipped, kind="stable")
    for t in order:
        corner = [tuple(at[v]) for v in patch.triangles[t]]
        pen.polygon(corner, fill=FOLDED if patch.flipped[t] else None)
        pen.line([*corner, corner[0]], fill=EDGE, width=2)
    edges = np.concatenate([patch.triangles, np.roll(patch.triangles, -1, axis=1)]).reshape(2, -1).T
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    for a, b in edges[first[count == 1]]:
        pen.line([tuple(at[a]), tuple(at[b])], fill=OUTLINE, width=5)
    return np.asarray(picture.resize((size, size), Image.Resampling.BOX))
