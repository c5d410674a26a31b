"""Pages of what the estimators say of a body's motion, and how far that is to be believed."""
