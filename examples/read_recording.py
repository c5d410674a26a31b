"""Read a recorded session as tables and compare an estimator with the table's tachometer.

Shown: the session's manifest, its export to Parquet (a file per bus key, units in the names of the
columns), and two of these tables side by side. `pandas.read_parquet(file)`, DuckDB, MATLAB and R
read the same files.

    python examples/read_recording.py SESSION_FOLDER
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from messages.contract import gyrofree_pb2 as pb
from sessions.export.export import export
from sessions.export.table import Selection
from sessions.recording.manifest import read_manifest

SAMPLE = Path(__file__).parent.parent / "tests/sessions/data/20240101-000000-table"


def main(session: Path = SAMPLE, device: str = "cube", estimator: str = "products-ekf") -> float:
    """RMS of the estimator's rate about z minus the tachometer's while the table turns and
    the estimator says that it knows the rate, deg/s.
    """
    manifest = read_manifest(session)
    seconds = (manifest.end_utc_ns - manifest.start_utc_ns) / 1e9
    print(f"{manifest.id}: {seconds:.1f} s of {', '.join(manifest.devices)}, {manifest.note}")
    for key, counted in manifest.keys.items():
        print(f"  {key}: {counted.messages} messages, {counted.lost} lost")

    with tempfile.TemporaryDirectory() as folder:
        wanted = Selection(topics=frozenset({"rate", "tacho"}))
        export(session / "recording.mcap", "parquet", Path(folder), wanted)
        rate = pq.read_table(Path(folder) / f"{device}.rate.{estimator}.parquet")
        tacho = pq.read_table(Path(folder) / f"{device}.tacho.parquet")

    t = rate["utc_s"].to_numpy()
    omega_z = rate["omega_ib_b_radps_z"].to_numpy()
    pulses, table = tacho["utc_s"].to_numpy(), tacho["omega_radps"].to_numpy()
    known = rate["sight_z"].to_numpy() == pb.RateEstimate.SIGHT_VALID  # else the sign may be wrong
    used = known & (t >= pulses[0]) & (t <= pulses[-1])
    difference = omega_z[used] - np.interp(t[used], pulses, table)
    rms = float(np.degrees(np.sqrt(np.mean(difference**2))))
    print(f"{estimator}: {rms:.2f} deg/s RMS against the tachometer over {used.sum()} estimates")
    return rms


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:2]))
