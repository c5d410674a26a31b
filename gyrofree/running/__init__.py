"""Processes: demo, supervisor, simulated boards, replays."""
