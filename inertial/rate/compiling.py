"""How the inner functions of the rate estimators are compiled.

Functions that make no array need not count references to those they are given; counting took a
tenth of a sample's time. Those that do make some say so, because they are called from the others.
An array that was made must not be returned to a function that does not count.
"""

from numba import njit

FAST = {"contract"}  # a product and a sum in one instruction; not-a-number stays one
lean = njit(cache=True, error_model="numpy", _nrt=False)
fused = njit(cache=True, error_model="numpy", _nrt=False, fastmath=FAST)
making = njit(cache=True, error_model="numpy", _nrt=True)
