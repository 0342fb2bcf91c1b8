"""Curves and control points → the canonical mesh, the map S (equations (1) and (2)), and its drawing."""
