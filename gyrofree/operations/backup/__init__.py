"""All that an installation must not lose, in one file, and back from it."""
