"""kill -9 of every service at random moments: what is lost, what is double, what had been
acknowledged.

    python tests/bench/bench_crash.py [kills of each service, default 20] [seed] [services, default
    all]

The whole demo stack runs (simulated table, 100 samples/s, two estimators, recording). Afterwards
every message of every session is read.
"""

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from support.kill_stack import SERVICES, Watch, account, bus_of, kill_all, line  # noqa: E402
from support.stack import RunningDemo  # noqa: E402


def main(rounds: int = 20, seed: int = 1, *services: str) -> None:
    """Run and print."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with RunningDemo(folder) as demo:
            watch = Watch(bus_of(demo))
            kills = []
            try:
                kill_all(demo, watch, rounds, seed, services or SERVICES, kills)
            except (
                AssertionError
            ) as error:  # the machine is too busy: what was done is accounted for all the same
                print(str(error).splitlines()[0], file=sys.stderr)
            watch.close()
        found = account(folder / "run", kills, watch.durable)
    more = {"kills": dict(found.kills), "seed": seed}
    line("crash_acknowledged_lost", found.acknowledged_lost, "messages", target=0, **more)
    line("crash_duplicates", found.duplicates, "messages", target=0, **more)
    line(
        "crash_longest_hole",
        round(max(found.missing_s.values(), default=0.0), 3),
        "s",
        target=1.0,
        **more,
    )
    for service in found.kills:
        line(
            f"crash_longest_hole_{service}",
            round(found.missing_s.get(service, 0.0), 3),
            "s",
            target=1.0,
        )
    line(
        "crash_samples_recorded",
        found.samples,
        "samples",
        missing_s=round(found.total_missing_s, 3),
    )
    line("crash_estimates_missing", found.estimates_missing, "estimates", of_samples=found.samples)
    line("crash_sessions", len(found.states), "sessions", states=sorted(set(found.states)))


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]), *sys.argv[3:])
