"""The composition root: configuration, processes and the one command line."""
