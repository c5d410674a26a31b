"""Inertial navigation: Earth, mechanisation, error model, filters, alignment."""
