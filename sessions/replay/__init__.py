"""A session goes through the pipeline again."""
