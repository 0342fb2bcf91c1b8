"""A picture without annotations -> regions: watershed basins, merged until every border pays for itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.regions.components import connected_components
from gcvec.regions.merging import AdjacencyGraph, adjacency_graph, merged
from gcvec.regions.partition import Partition
from gcvec.regions.watershed import flooded, minima
from gcvec.smoothing import box_mean, gaussian

REGION = "region"
"""Name of the regions found."""

_SEED_PIXELS = 1_000_000
"""Basins are found on a picture reduced to this size; their borders in the picture itself."""

CLEAR_STEP, FAINT_STEP = 28.0, 14.0
"""The colour step, levels, at which a long border saves as much as it costs; and a lower one, for many
regions where none may have many control points."""

_TEXTURE_SHARE = 0.4
"""The share of the mean squared step around a place that counts as texture, not as an edge."""

_TEXTURE_WINDOW = 21
"""The width of that surrounding, pixels."""

_Colors = NDArray[np.float32]


def segment(
    pixels: NDArray[np.uint8],
    regions: int = 0,
    least_step: float = FAINT_STEP,
    load: NDArray[np.floating] | None = None,
    most_load: float = np.inf,
    most_border: float = np.inf,
) -> Partition:
    """Divide `pixels (h, w, 3)` along image edges.

    The number of regions follows from the picture, one if it holds no edge of `least_step` levels or more; or
    it is fewer, so that there are no more than `most_border` cracks between pixels of different regions; or
    it is `regions`, less only if the picture has fewer basins that are no slivers. No region has more than
    about `most_load` of the `load (h, w)` of its pixels, none under `SLIVER_AREA` pixels. Borders lie where
    the colour changes most. Deterministic.
    """
    colors = pixels.astype(np.float32)
    scale = max(round(np.sqrt(colors[..., 0].size / _SEED_PIXELS)), 1)
    basins = _basins(colors, scale)
    steepness = _steepness(colors, scale)
    graph = _graph(basins, colors, steepness, scale, least_step)
    loads = None if load is None else np.bincount(basins.ravel(), load.ravel()).astype(np.float64)
    areas = np.bincount(basins.ravel())
    groups = merged(graph, areas, regions, loads, most_load, most_border)
    labels = connected_components(groups.astype(np.int32)[basins])
    return Partition(labels, (REGION,) * (int(labels.max()) + 1))


def _steepness(colors: _Colors, sigma: float) -> NDArray[np.float32]:
    """The step of the ideal edge that has the picture's gradient at this smoothing, levels, `(h, w)`."""
    square = np.zeros(colors.shape[:2], dtype=np.float32)
    for channel in np.moveaxis(colors, 2, 0):
        for order in ((0, 1), (1, 0)):
            square += np.square(gaussian(channel, sigma, order))
    return np.sqrt(square / 3) * np.float32(sigma * np.sqrt(2 * np.pi))


def _basins(colors: _Colors, scale: int) -> NDArray[np.int32]:
    """Watershed basins of the steepness, numbered from 0, `(h, w)`."""
    steepness = _steepness(colors, 1)
    markers = None if scale == 1 else _markers(colors, scale)
    return _flooded(steepness, markers)


def _flooded(steepness: NDArray[np.float32], markers: NDArray[np.int32] | None = None) -> NDArray[np.int32]:
    """Basins, numbered from 0, around the markers, else around every minimum."""
    return flooded(steepness, minima(steepness) if markers is None else markers) - 1


def _markers(colors: _Colors, scale: int) -> NDArray[np.int32]:
    """The lowest place of every basin of the reduced picture, numbered from 1 in the picture itself."""
    height, width = colors.shape[0] // scale, colors.shape[1] // scale
    blocks = colors[: height * scale, : width * scale].reshape(height, scale, width, scale, 3)
    steepness = _steepness(blocks.mean(axis=(1, 3)), 1)
    basins = _flooded(steepness)
    order = np.lexsort((steepness.ravel(), basins.ravel()))
    lowest = order[np.flatnonzero(np.diff(basins.ravel()[order], prepend=-1))]
    markers = np.zeros(colors.shape[:2], dtype=np.int32)
    y, x = np.divmod(lowest, width)
    markers[y * scale + scale // 2, x * scale + scale // 2] = np.arange(1, len(lowest) + 1)
    return markers


def _graph(
    basins: NDArray[np.int32],
    colors: _Colors,
    steepness: NDArray[np.float32],
    scale: int,
    least_step: float,
) -> AdjacencyGraph:
    """The adjacency graph of the basins, with the colour steps beyond what the texture around explains, in
    units of the least one."""
    smooth = np.stack([gaussian(channel, scale) for channel in np.moveaxis(colors, 2, 0)], axis=2)
    around = box_mean(np.square(steepness, dtype=np.float64), _TEXTURE_WINDOW * scale | 1)
    texture = np.asarray(_TEXTURE_SHARE * around, np.float32)
    parts = [_cracks(basins, smooth, texture, scale)]
    parts.append(_cracks(basins.T, smooth.transpose(1, 0, 2), texture.T, scale))
    origin, target, step = (np.concatenate(values) for values in zip(*parts, strict=True))
    return adjacency_graph(origin, target, step / least_step)


def _cracks(
    basins: NDArray[np.int32], smooth: _Colors, texture: NDArray[np.float32], reach: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Every crack between a pixel and its right neighbour: the basins there, and the step `(n, 3)`, taken
    `reach` pixels further out on both sides, where an edge of a photo has reached its full height."""
    y, x = np.nonzero(basins[:, :-1] != basins[:, 1:])
    width = basins.shape[1]
    step = smooth[y, np.minimum(x + 1 + reach, width - 1)] - smooth[y, np.maximum(x - reach, 0)]
    energy = np.maximum(np.square(step).mean(axis=1), 1e-6)
    clear = np.sqrt(np.maximum(1 - texture[y, x] / energy, 0))
    origin, target = basins[y, x].astype(np.int64), basins[y, x + 1].astype(np.int64)
    return origin, target, step.astype(np.float64) * clear[:, None]
