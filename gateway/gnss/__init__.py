"""Receiver bytes become fixes."""
