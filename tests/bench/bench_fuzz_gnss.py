"""Messages of receivers with right checksums and any content: no exception, memory flat.

    python tests/bench/bench_fuzz_gnss.py [--messages 100000] [--seed 1]

Half are random NMEA sentences and UBX frames, half are sound ones with fields or bytes changed.
Each fix that comes out is held to the bus contract. Exits 1 when something is not.
"""

import argparse
import math
import random
import resource
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.receivers import mutated, random_message  # noqa: E402

from gateway.gnss.link import GnssLink  # noqa: E402
from gateway.samples import convert  # noqa: E402
from messages.contract.checks import check  # noqa: E402

START_S = 1718366400
MOST_GROWN_MB = 8.0  # after the first tenth


def main() -> int:
    """The program; 0 when everything was taken or refused."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--messages", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    draw, link = random.Random(options.seed), GnssLink()
    fixes = wrong = 0
    began, early = time.perf_counter(), 0.0
    for k in range(options.messages):
        data = mutated(draw) if k % 2 else random_message(draw)
        for arrival in link.feed(data, 10_000 * (k + 1), None, START_S * 10**9):
            message = convert.gnss_fix(arrival.fix)
            message.device_time_s = max(0.0, arrival.device_time_s)
            wrong += check(message) != [] or not math.isfinite(arrival.device_time_s)
            wrong += bool(message.quality and check(convert.location_fix(message, "cube")))
            fixes += 1
        if k == options.messages // 10:
            early = _megabytes()
    grown, decoder = _megabytes() - early, link.decoder
    print(f"{options.messages} messages in {time.perf_counter() - began:.1f} s: {fixes} fixes")
    names, damaged = len(decoder.refused), decoder.stream.bad
    print(f"{decoder.unreadable} refused by {names} names, {damaged} damaged")
    print(f"{wrong} fixes against the contract; memory grew by {grown:.1f} MB")
    return 1 if wrong or grown > MOST_GROWN_MB else 0


def _megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


if __name__ == "__main__":
    sys.exit(main())
