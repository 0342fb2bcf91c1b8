"""What a picture shows of the rounding of its colours, so that those stored later can make up for it.

Blending functions overlap, and pixels are means over their squares, all the more where control points are
dense. So part of what one colour is off by after rounding is taken back by storing its neighbours a little
differently: error diffusion, as in halftoning (Floyd and Steinberg 1976), by just as much as the squared
error of the picture asks for. Files do not tell, and readers need not know.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.colors import to_coordinates
from gcvec.colors.color_fit import ColorFit
from gcvec.kernels import bare_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Echo(NamedTuple):
    """What a picture with p pixels is off by, for the colours rounded so far, and what n points give to it.

    start   (n + 1,) int32, where the entries of each point begin
    pixel   (k,) int32, of each entry
    weight  (k,) float32, how much of the pixel's colour is the point's
    error   (p, 3) float32, along the axes of the basis, in steps; of no pixels where there is no picture
    """

    start: Ints
    pixel: Ints
    weight: NDArray[np.float32]
    error: NDArray[np.float32]


def silence() -> Echo:
    """Of no picture: every colour is rounded for itself."""
    nothing = np.zeros((0, 3), np.float32)
    return Echo(np.zeros(1, np.int32), np.zeros(0, np.int32), nothing[:, 0].copy(), nothing)


def echo_of(fit: ColorFit, off: Floats, n_points: int, step: float) -> Echo:
    """Of the picture that colours are fitted to, while boundary colours are `off` by so much `(b, 3)`, and
    the n points, whose steps are `step`, not at all."""
    columns = fit.columns
    on_mesh = to_coordinates(fit.operator @ np.concatenate([off, np.zeros((n_points, 3))]), step)
    error = fit.design @ on_mesh.astype(np.float32)
    return Echo(columns.indptr, columns.indices, columns.data, error)


@bare_kernel
def make_up(echo: Echo, i: int, wish: Floats) -> None:
    """Change the coordinates wished for point i `(3,)`, in steps, by what makes up best for what the picture
    is off by."""
    if len(echo.error) == 0:
        return
    first, second, third, energy = 0.0, 0.0, 0.0, 1e-12
    for e in range(echo.start[i], echo.start[i + 1]):
        weight, pixel = echo.weight[e], echo.pixel[e]
        first += weight * echo.error[pixel, 0]
        second += weight * echo.error[pixel, 1]
        third += weight * echo.error[pixel, 2]
        energy += weight * weight
    wish[0] -= first / energy
    wish[1] -= second / energy
    wish[2] -= third / energy


@bare_kernel
def add_to(echo: Echo, i: int, off: Floats) -> None:
    """Note that point i is off by so many steps along the axes `(3,)`."""
    if len(echo.error) == 0:
        return
    for e in range(echo.start[i], echo.start[i + 1]):
        weight, pixel = echo.weight[e], echo.pixel[e]
        for axis in range(3):
            echo.error[pixel, axis] += weight * off[axis]
