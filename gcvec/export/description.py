"""The patch description, format "gcvec/1": complete, so that a client can draw the picture from it alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.planar_graph import OUTSIDE
from gcvec.export.triangles import drawn_triangles
from gcvec.patches.color_space import LEFT, RIGHT
from gcvec.vector_image import VectorImage

FORMAT = "gcvec/1"


def describe(image: VectorImage) -> dict[str, Any]:
    """JSON-ready description. Positions are pixels, colours sRGB in [0, 1]."""
    report = image.report
    return {
        "format": FORMAT,
        "image": {"width": image.width, "height": image.height},
        "curves": _curves(image),
        "patches": _patches(image),
        "mesh": _mesh(image),
        "metrics": _metrics(image),
        "seconds": dict(report.seconds) if report else {},
        "warnings": list(image.warnings),
    }


def _rounded(values: NDArray[np.float64], digits: int = 4) -> list[Any]:
    rounded: list[Any] = np.round(values, digits).tolist()
    return rounded


def _metrics(image: VectorImage) -> dict[str, Any]:
    if image.report is None:
        return {"patches": len(image.labels), "points": len(image.points), "foldovers": image.foldovers}
    report = image.report.as_dict()
    return {key: value for key, value in report.items() if key not in ("image", "seconds", "regions")}


def _curves(image: VectorImage) -> list[dict[str, Any]]:
    foundation = image.foundation
    offsets, unknown = foundation.samples.offsets, foundation.space.of_control
    curves, colors = [], image.colors
    for c, curve in enumerate(image.network.curves):
        own = slice(offsets[c], offsets[c + 1])
        sides = {}
        for name, side, patch in (("right", RIGHT, curve.right), ("left", LEFT, curve.left)):
            if patch != OUTSIDE:
                sides[name] = _rounded(colors[unknown[side, own]])
        hard = bool(image.hard[c])
        curves.append(
            {
                "id": c,
                "degree": 3,
                "closed": curve.closed,
                "segments": curve.segments,
                "control_points": _rounded(foundation.control_points[own]),
                "hard": hard,
                "colors": sides if hard else next(iter(sides.values())),
                "left": None if curve.left == OUTSIDE else curve.left,
                "right": None if curve.right == OUTSIDE else curve.right,
            }
        )
    return curves


def _patches(image: VectorImage) -> list[dict[str, Any]]:
    first_edge = np.searchsorted(
        image.foundation.samples.edge_curve, np.arange(len(image.network.curves) + 1)
    )
    owner = image.patch_of_points
    patches = []
    for k, label in enumerate(image.labels):
        loops, polygons = _loops(image, k, first_edge)
        points = _points(image, np.flatnonzero(owner == k))
        patch = {"id": k, "label": label, "loops": loops, "domain": polygons, "points": points}
        if image.report:
            region = image.report.regions[k]
            patch["metrics"] = {"points": region.points, "iterations": region.iterations, "mse": region.mse}
        patches.append(patch)
    return patches


def _loops(
    image: VectorImage, patch: int, first_edge: NDArray[np.int64]
) -> tuple[list[list[dict[str, Any]]], list[list[list[float]]]]:
    """The stretches of curves that bound a patch, and the vertices of its parameter polygon where they begin:
    loop by loop, the outer one first. `first_edge` `(c + 1,)` is where each curve's polygon edges begin."""
    samples = image.foundation.samples
    loops: list[list[dict[str, Any]]] = []
    polygons: list[list[list[float]]] = []
    for loop in image.network.loops[patch]:
        spans, polygon = [], []
        for c, forward in loop:
            way = 1 if forward else -1
            for edge in np.arange(first_edge[c], first_edge[c + 1])[::way]:
                u0, u1 = samples.edge_u[edge][::way]
                spans.append({"curve": c, "from": float(u0), "to": float(u1)})
                polygon.append(_rounded(samples.domain[samples.edge_ends[edge, 0 if forward else 1]]))
        outer = _double_area(polygon) > 0
        loops.insert(0 if outer else len(loops), spans)
        polygons.insert(0 if outer else len(polygons), polygon)
    return loops, polygons


def _points(image: VectorImage, which: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Some of the interior control points."""
    domain = image.canvas.mesh.vertices[image.canvas.mesh.n_samples :]
    colors = image.colors[len(image.boundary_colors) :]
    columns = (domain[which], image.canvas.places[which], colors[which])
    return [
        {"domain": place, "image": moved, "color": color}
        for place, moved, color in zip(*map(_rounded, columns), strict=True)
    ]


def _double_area(polygon: list[list[float]]) -> float:
    """Twice the area of a polygon with its inside to the right (y points down), negative for a hole."""
    return sum(
        ax * by - ay * bx for (ax, ay), (bx, by) in zip(polygon, polygon[1:] + polygon[:1], strict=True)
    )


def _mesh(image: VectorImage) -> dict[str, Any]:
    """The canonical mesh as it is drawn: one entry a corner colour, so that hard edges stay sharp."""
    drawn = drawn_triangles(image)
    return {
        "positions": _rounded(drawn.positions, 3),
        "colors": _rounded(drawn.colors, 4),
        "triangles": drawn.corners.tolist(),
    }
