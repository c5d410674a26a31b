"""A test as a procedure: what is to be done, whether it is done well, and what came of it. model
reads the file, watch looks at the data, conductor goes from step to step, service speaks on the
bus, evaluate judges a recording.
"""
