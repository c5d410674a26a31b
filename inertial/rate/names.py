"""The rate estimators that run where nobody names others. The tables of all are slow to load."""

USUAL = ("products-ekf", "least-squares")
LEADER = USUAL[0]  # the one that is believed
