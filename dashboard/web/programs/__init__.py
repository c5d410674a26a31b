"""What programs use: tokens, live values."""
