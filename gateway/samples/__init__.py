"""Frames become samples in SI units."""
