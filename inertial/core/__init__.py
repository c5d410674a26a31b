"""The hot loops of inertial/, compiled from the C++ beside this file: the same bits everywhere.

Two builds of the same sources: for any processor (plain), and for x86-64-v3 (AVX2), taken where the
processor has it. GYROFREE_CORE=plain takes the first one anywhere; the bits are the same, only the
speed is not. `make setup` builds the one that this machine runs, tests and wheels have both.
"""

import importlib
import os
from pathlib import Path
from types import ModuleType

LEVEL_3 = frozenset("avx avx2 bmi1 bmi2 f16c fma abm movbe".split())
"""What x86-64-v3 asks of a processor, as Linux names it."""


def _runs_v3() -> bool:
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return False
    flags = next((line for line in text.splitlines() if line.startswith("flags")), "")
    return LEVEL_3 <= set(flags.split())


def builds() -> dict[str, ModuleType]:
    """Every build that is here and that this processor runs, by its name; the fastest first."""
    found = {}
    for name in ("v3", "plain") if _runs_v3() else ("plain",):
        try:
            found[name] = importlib.import_module(f"inertial.core._core_{name}")
        except ModuleNotFoundError:
            continue
    return found


def _chosen() -> ModuleType:
    wanted, found = os.environ.get("GYROFREE_CORE", ""), builds()
    if wanted and wanted not in found:
        raise ImportError(
            f"GYROFREE_CORE={wanted}: no such build here ({', '.join(found) or 'none'}); want plain"
            " or v3, and `make dev` builds both"
        )
    if not found:
        raise ImportError("inertial.core is not built for this processor: run `make setup`")
    return found[wanted] if wanted else next(iter(found.values()))


native = _chosen()
BUILD = native.__name__.rpartition("_")[2]
"""Which build was taken: "plain" or "v3"."""
VERSION: str = native.VERSION
"""Digest of the sources it was built from: equal digests give equal bits."""

navigation = native.navigation
"""Strapdown, error model, filters (inertial/navigation)."""

attitude = native.attitude
"""Tilt filters of six-axis boards (inertial/attitude)."""
