"""What crosses the bus becomes a session on disk."""
