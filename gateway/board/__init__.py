"""One device: its frames in, its messages out, its orders and its health."""
