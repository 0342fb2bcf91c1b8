"""Original, reconstruction and error map, with the columns of the paper's Table 1 (Fig. 7)."""

from __future__ import annotations

import numpy as np

from examples import figures
from examples.scenes import balls, vectorized_balls
from gcvec.export import error_map

COLUMNS = ("added points", "patches", "average error", "MSE", "storage (KB)")
STAGES = ("mesh_harmonic", "evaluation", "optimization", "total")


def main() -> dict[str, float]:
    """The row of Table 1 for the made scene; seconds by stage last."""
    scene, image = balls(), vectorized_balls()
    report = image.report
    assert report is not None
    error = error_map(scene.pixels, image)
    figures.save("results", [[scene.pixels, image.render(), error]])
    values = (report.points, report.patches, report.mae, report.mse, report.bytes / 1000)
    row = dict(zip(COLUMNS, map(float, values), strict=True))
    measured = (image.render().astype(np.float64) - scene.pixels) ** 2
    return {**row, "MSE measured": float(measured.mean())} | {s: report.seconds[s] for s in STAGES}


if __name__ == "__main__":
    for name, value in main().items():
        print(f"{name:<16}{value:>12.2f}")
