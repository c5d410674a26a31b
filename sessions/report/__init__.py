"""The report of a session: what was measured, how well, and whether that is enough. Same recording,
same bytes.
"""
