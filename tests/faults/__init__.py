"""Every listed fault, done to real processes: what is lost, what is said, when it is well again."""
