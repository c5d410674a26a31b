"""Rotation from accelerometers alone: field, standstill, and every rate estimator behind one
protocol.
"""
