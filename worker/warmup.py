"""Loads the engine and its compiled kernels before the first job arrives."""

from __future__ import annotations

import logging
import time

import numpy as np

logger = logging.getLogger(__name__)

_SIDE = 24


def warm_up() -> None:
    """Vectorize a small picture of two colours."""
    from gcvec import Options, vectorize
    from gcvec.export import error_map, patch_overlay

    started = time.perf_counter()
    pixels = np.full((_SIDE, _SIDE, 3), 40, np.uint8)
    pixels[:, _SIDE // 2 :] = np.linspace(90, 250, _SIDE, dtype=np.uint8)[:, None, None]
    result = vectorize(pixels, None, Options(max_points=10, workers=1))
    result.render()
    error_map(pixels, result)
    patch_overlay(result)
    logger.info("engine ready after %.1f s", time.perf_counter() - started)


if __name__ == "__main__":
    warm_up()
