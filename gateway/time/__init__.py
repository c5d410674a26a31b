"""Device time becomes UTC."""
