"""Annotated shapes, or a picture alone → a label map: every pixel in exactly one connected region."""
