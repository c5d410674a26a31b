"""Bytes become samples: ports, journal, clock, GNSS, publication."""
