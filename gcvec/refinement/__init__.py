"""Interior control points where the error is (paper, section 4.4): rounds, and the file they end in."""
