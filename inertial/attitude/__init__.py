"""Rotations, and attitude from accelerometers and gyroscopes."""
