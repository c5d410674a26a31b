"""Logs on disk instead of the bus: run, score, draw."""
