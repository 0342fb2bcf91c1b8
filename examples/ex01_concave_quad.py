"""A concave region with four sides (paper, Figs. 2 and 9).

The classical Coons patch maps a square and folds over at the reflex corner. The generalized patch maps a
polygon that looks like the region, and does not.
"""

from __future__ import annotations

from examples import figures
from examples.coons import bow, classical_coons, corners, generalized_coons

P1, P2, P3, P4 = (0.0, 0.0), (1.0, 0.1), (0.25, 0.3), (0.1, 1.0)
CURVES = (bow(P1, P2, -0.1), bow(P2, P3, 0.06), bow(P3, P4, 0.06), bow(P4, P1, -0.1))


def main() -> dict[str, int]:
    """Triangles turned over by each patch."""
    classical = classical_coons(CURVES)
    ours = generalized_coons(corners(CURVES), CURVES)
    figures.save("concave_quad", [figures.mesh_panels(classical), figures.mesh_panels(ours)])
    return {
        "classical flipped": int(classical.flipped.sum()),
        "classical triangles": len(classical.triangles),
        "generalized flipped": int(ours.flipped.sum()),
        "generalized triangles": len(ours.triangles),
    }


if __name__ == "__main__":
    print(main())
