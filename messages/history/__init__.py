"""What crossed the bus is kept, asked for and mended."""
