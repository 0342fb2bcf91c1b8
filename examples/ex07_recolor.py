"""Colours change and the shading stays (paper, Fig. 11): the red ball turns orange, the blue one violet."""

from __future__ import annotations

import numpy as np

from examples import figures
from examples.scenes import vectorized_balls
from gcvec.edit import Recolor, edit, hex_color, mean_color

CHANGES = {"ball 0": "#c8641e", "ball 1": "#7a50b4"}


def main() -> dict[str, float]:
    """Largest distance of a new mean colour from the one asked for, in levels; share of pixels changed."""
    image = vectorized_balls()
    recolors = [Recolor(image.labels.index(name), hex_color(color)) for name, color in CHANGES.items()]
    edited = edit(image, recolors=recolors)
    off = [np.abs(mean_color(edited, r.patch) - r.color).max() * 255 for r in recolors]
    changed = (image.render() != edited.render()).any(axis=2)
    figures.save("recolor", [[image.render(), edited.render()]])
    return {"off": float(max(off)), "changed": float(changed.mean()), "foldovers": edited.foldovers}


if __name__ == "__main__":
    print(main())
