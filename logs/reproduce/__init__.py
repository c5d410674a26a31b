"""Published studies again: the table test of the gyro-free cube, the comparison of alignments."""
