"""Measures gcvec: time, memory, points and bytes, beside other picture formats. `make bench` runs it."""
