"""Sessions become tables and files of other programs."""
