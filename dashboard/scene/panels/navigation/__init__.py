"""Pages of position: filters against each other, their horizon, and what is left without fixes."""
