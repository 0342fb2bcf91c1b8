"""Colours by least squares: along the curves first, then all of them (equation (7))."""
