"""Borders → cubic B-splines on the file's grid, and the polygons that are their parameter domains."""
