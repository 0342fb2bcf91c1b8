"""Runnable examples and the sample picture they share."""
