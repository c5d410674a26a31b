"""What another place sees of a site over a slow link: one row of each topic so often a second."""
