"""A made scene of straight walls, round hills and junctions whose true outlines are known exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import shapely
import shapely.affinity
from numpy.typing import NDArray

from gcvec import Annotations, Shape

Floats = NDArray[np.float64]

WIDTH, HEIGHT = 260, 200
SUPERSAMPLING = 8
HAND = 0.8
"""A drawn outline stays within this distance of the true one, pixels."""

CLICK_SPACING = 9.0
MANY = 256
"""Chords of a quarter circle: off by 0.0004 pixels at a radius of 80."""


@dataclass(frozen=True)
class Solid:
    """A region with its colour at the centre of the picture and the change of colour across it."""

    name: str
    outline: shapely.Polygon
    color: tuple[float, float, float]
    slope: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Buildings:
    """The scene and its truth.

    pixels       (h, w, 3) uint8, averaged over each pixel
    annotations  outlines as a hand would draw them; the sky is not drawn
    borders      the visible borders
    corners      (n, 2) where a border of two regions turns, pixels
    junctions    (n, 2) where three or more regions meet
    """

    pixels: NDArray[np.uint8]
    annotations: Annotations
    borders: shapely.MultiLineString
    corners: Floats
    junctions: Floats


def _walls(points: list[tuple[float, float]]) -> shapely.Polygon:
    """An outline of the house, which stands askew."""
    return shapely.affinity.rotate(shapely.Polygon(points), 4, origin=(60, 130))


def _box(left: float, top: float, right: float, bottom: float, degrees: float) -> shapely.Polygon:
    return shapely.affinity.rotate(shapely.box(left, top, right, bottom), degrees)


def _disc(x: float, y: float, radius: float) -> shapely.Polygon:
    return shapely.Point(x, y).buffer(radius, quad_segs=MANY)


def _sectors(x: float, y: float, radius: float, degrees: list[float]) -> list[shapely.Polygon]:
    """Slices of a disc between consecutive directions."""
    disc = _disc(x, y, radius)
    angle = np.deg2rad([*degrees, degrees[0] + 360])
    slices = []
    for a, b in zip(angle[:-1], angle[1:], strict=True):
        turn = np.linspace(a, b, 9)
        fan = np.stack([x + 2 * radius * np.cos(turn), y + 2 * radius * np.sin(turn)], axis=1)
        slices.append(disc & shapely.Polygon([(x, y), *fan]))
    return slices


def solids() -> tuple[Solid, ...]:
    """Back to front."""
    front = [(30, 96), (70, 96), (70, 168), (30, 168)]
    roof = [(20, 98), (80, 98), (50, 98 - 30 * 3**0.5)]
    tower = [(92, 62), (110, 62), (110, 174), (92, 174)]
    lawn = shapely.box(-20, 158.3, WIDTH + 20, HEIGHT + 20)
    three = _sectors(208.4, 44.7, 27.3, [17, 137, 257])
    four = _sectors(207.6, 118.9, 25.6, [31, 127, 203, 299])
    five = _sectors(140.3, 41.6, 24.8, [5, 70, 146, 221, 293])
    slices = [*three, *four, *five]
    colors = [
        (0.75, 0.30, 0.22), (0.28, 0.55, 0.32), (0.85, 0.80, 0.45),
        (0.20, 0.30, 0.55), (0.80, 0.55, 0.30), (0.35, 0.20, 0.30), (0.60, 0.75, 0.55),
        (0.90, 0.88, 0.80), (0.55, 0.20, 0.45), (0.25, 0.50, 0.50), (0.80, 0.40, 0.20), (0.30, 0.25, 0.20),
    ]  # fmt: skip
    return (
        Solid("hill", _disc(45.2, 214.6, 103.7), (0.56, 0.67, 0.74), (0.05, 0.0)),
        Solid("lawn", lawn, (0.36, 0.50, 0.24), (0.04, -0.03)),
        Solid("front", _walls(front), (0.82, 0.74, 0.60)),
        Solid("roof", _walls(roof), (0.62, 0.24, 0.18)),
        Solid("tower", _walls(tower), (0.48, 0.42, 0.36)),
        Solid("window", _box(44, 118, 60, 140, 9), (0.22, 0.25, 0.32)),
        Solid("shed", _box(126, 106, 165, 144, -23), (0.45, 0.32, 0.24)),
        *(Solid(f"slice {k}", s, c) for k, (s, c) in enumerate(zip(slices, colors, strict=True))),
    )


@cache
def buildings(seed: int = 0) -> Buildings:
    """A house with a tower, a shed, a pale hill, and discs cut into three, four and five slices."""
    scene = solids()
    frame = shapely.box(0, 0, WIDTH, HEIGHT)
    visible, hidden = [], shapely.Polygon()
    for solid in reversed(scene):
        visible.append((solid.outline - hidden) & frame)
        hidden = hidden | solid.outline
    visible.append(frame - hidden)
    lines = shapely.union_all([shapely.boundary(region) for region in visible])
    inside = shapely.line_merge(lines - shapely.boundary(frame).buffer(1e-6))
    corners, junctions = _turns_and_meetings(visible)
    rng = np.random.default_rng(seed)
    shapes = tuple(
        Shape(solid.name, rings=(_drawn(solid.outline, rng),), z_order=k) for k, solid in enumerate(scene)
    )
    return Buildings(_picture(scene), Annotations(shapes, WIDTH, HEIGHT), inside, corners, junctions)


def _turns_and_meetings(regions: list[shapely.Polygon]) -> tuple[Floats, Floats]:
    """Corners of two regions and junctions of more, away from the frame."""
    corners, junctions = [], []
    for region in regions:
        for polygon in getattr(region, "geoms", [region]):
            for ring in (polygon.exterior, *polygon.interiors):
                points = shapely.get_coordinates(ring)[:-1]
                before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
                cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
                turn = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
                away = ((points > 1) & (points < (WIDTH - 1, HEIGHT - 1))).all(axis=1)
                distance = shapely.distance(np.array(regions)[:, None], shapely.points(points))
                meets = (distance < 1e-6).sum(axis=0) > 2
                junctions.append(points[away & meets])
                corners.append(points[away & ~meets & (turn > np.deg2rad(25))])
    turns, meetings = np.concatenate(corners), np.concatenate(junctions)
    return np.unique(np.round(turns, 6), axis=0), np.unique(np.round(meetings, 6), axis=0)


def _picture(scene: tuple[Solid, ...]) -> NDArray[np.uint8]:
    y, x = (np.mgrid[: HEIGHT * SUPERSAMPLING, : WIDTH * SUPERSAMPLING] + 0.5) / SUPERSAMPLING
    u, v = x / WIDTH - 0.5, y / HEIGHT - 0.5
    fine = np.stack([0.60 + 0.06 * v, 0.72 + 0.05 * v, 0.80 - 0.03 * u], axis=-1)
    for solid in scene:
        left, top, right, bottom = (int(n) for n in np.array(solid.outline.bounds) * SUPERSAMPLING)
        window = slice(max(top, 0), bottom + 2), slice(max(left, 0), right + 2)
        shapely.prepare(solid.outline)
        inside = shapely.contains_xy(solid.outline, x[window], y[window])
        shade = solid.slope[0] * u[window] + solid.slope[1] * v[window]
        fine[window][inside] = np.array(solid.color) + shade[inside, None]
    blocks = fine.reshape(HEIGHT, SUPERSAMPLING, WIDTH, SUPERSAMPLING, 3).mean(axis=(1, 3))
    return np.rint(np.clip(blocks, 0, 1) * 255).astype(np.uint8)


def _drawn(outline: shapely.Polygon, rng: np.random.Generator) -> Floats:
    """The outline clicked every few pixels and at every corner, each click off by at most `HAND`."""
    simple = shapely.get_coordinates(shapely.simplify(outline, 0.3).exterior)[:-1]
    clicks = []
    for a, b in zip(simple, np.roll(simple, -1, axis=0), strict=True):
        n = max(int(np.hypot(*(b - a)) // CLICK_SPACING), 1)
        clicks.append(a + (np.arange(n) / n)[:, None] * (b - a))
    placed = np.concatenate(clicks)
    angle, radius = rng.uniform(0, 2 * np.pi, len(placed)), HAND * rng.uniform(0, 1, len(placed)) ** 0.5
    return np.asarray(placed + (radius * np.array([np.cos(angle), np.sin(angle)])).T)
