"""Boards that are no hardware: played and simulated ones."""
