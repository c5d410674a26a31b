"""Calibration of accelerometer axes: poses, table steps, one least squares, and the card that keeps
the result.
"""
