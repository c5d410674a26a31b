"""Pages of the device itself: its line, its board, the health and the layout of its axes."""
