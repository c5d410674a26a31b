"""Logs as tables: what estimators said, and foreign files before they are read."""
