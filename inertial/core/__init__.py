"""The hot loops of inertial/, compiled from the C++ beside this file: the same bits on every processor.

Two builds of the same sources: for any x86-64, and for x86-64-v3 (AVX2), taken where the processor
has it. GYROFREE_CORE=plain takes the first one anywhere; the bits are the same, only the speed is not.
"""

import os

from inertial.core import _core_plain

if os.environ.get("GYROFREE_CORE") != "plain" and _core_plain.runs_v3():
    from inertial.core import _core_v3 as native
else:
    native = _core_plain

BUILD = native.__name__.rpartition("_")[2]
"""Which build was taken: "plain" or "v3"."""
VERSION: str = native.VERSION
"""Digest of the sources it was built from: equal digests give equal bits."""

navigation = native.navigation
"""Strapdown, error model, filters (inertial/navigation)."""

attitude = native.attitude
"""Tilt filters of six-axis boards (inertial/attitude)."""
