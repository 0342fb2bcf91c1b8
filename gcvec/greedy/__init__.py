"""Greedy placement of interior control points on a mesh that changes with every point."""

from gcvec.greedy.begin import Shown, begin_placement
from gcvec.greedy.placement import Placement

__all__ = ["Placement", "Shown", "begin_placement"]
