"""The Zenoh session."""
