"""Samples become motion: pure maths modules, one per subject, and one service shell."""
