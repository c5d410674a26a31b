"""Where the accelerometer axes sit and point, and what a layout can see."""
