"""Why a parameter domain has its region's shape (paper, Fig. 5): a hook with six sides over two hexagons."""

from __future__ import annotations

import numpy as np

from examples import figures
from examples.coons import bow, corners, generalized_coons, regular_polygon

HOOK = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 0.25), (0.25, 0.25), (0.25, 1.0), (0.0, 1.0)])
BULGES = (-0.05, -0.1, 0.08, 0.08, -0.1, -0.05)
CURVES = tuple(bow(a, b, bulge) for a, b, bulge in zip(HOOK, np.roll(HOOK, -1, axis=0), BULGES, strict=True))


def main() -> dict[str, int]:
    """Triangles turned over with the regular hexagon and with the adapted one."""
    regular = generalized_coons(regular_polygon(6), CURVES)
    adapted = generalized_coons(corners(CURVES), CURVES)
    figures.save("regular_hexagon", [figures.mesh_panels(regular), figures.mesh_panels(adapted)])
    return {"regular flipped": int(regular.flipped.sum()), "adapted flipped": int(adapted.flipped.sum())}


if __name__ == "__main__":
    print(main())
