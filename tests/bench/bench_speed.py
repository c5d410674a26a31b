"""What a 12-axis sample costs, from readings to messages: one JSON line per figure.

batch   through field and filter by run_batch, us per sample (wanted: 2)
live    from a parsed AccelBatch to serialised messages, by Pipeline.on at default settings, us per
sample (wanted: 30) cubes   64 boards at 100 Hz through one Pipeline, CPU seconds per second of data
(wanted: below 1) Process time, so that what else the machine does counts little; the least of
several rounds.
Usage: python tests/bench/bench_speed.py [rounds]
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent))

from estimator.pipeline import Pipeline  # noqa: E402
from estimator.settings import EstimatorSettings  # noqa: E402
from inertial.rate.estimators import ESTIMATORS  # noqa: E402
from inertial.simulation.table import TableTest  # noqa: E402
from messages.contract import gyrofree_pb2 as pb  # noqa: E402
from messages.contract.topics import ACCEL  # noqa: E402

UTC_NS = 1_700_000_000 * 10**9
DT = 0.01  # s
WARM_S, SPAN_S = 8.0, 10.0  # standstill and the start of the first turn; then what is measured


def table() -> tuple[np.ndarray, np.ndarray, TableTest]:
    """Times (n,), s, and readings (n, 12), m/s^2, of the published profile."""
    test = TableTest(1)
    blocks = [test.block(k) for k in range(3)]
    return (
        np.concatenate([b.t_s for b in blocks]),
        np.concatenate([b.readings for b in blocks]),
        test,
    )


def batch(rounds: int) -> None:
    """run_batch over ten seconds of turning, after the standstill."""
    t_s, readings, test = table()
    first, last = round(WARM_S / DT), round((WARM_S + SPAN_S) / DT)
    for name, make in ESTIMATORS.items():
        if not hasattr(make, "run_batch"):
            continue
        best = np.inf
        for _ in range(rounds):
            estimator = make(test.layout)
            estimator.run_batch(t_s[:first], readings[:first])
            began = time.process_time_ns()
            estimator.run_batch(t_s[first:last], readings[first:last])
            best = min(best, (time.process_time_ns() - began) / 1e3 / (last - first))
        say("batch", estimator=name, us_per_sample=round(best, 2))


def messages(device: str, readings: np.ndarray, size: int) -> list[pb.AccelBatch]:
    """What a gateway publishes: batches of `size` samples."""
    return [
        pb.AccelBatch(
            header=pb.Header(
                device=device,
                sequence=k // size + 1,
                epoch=1,
                device_us=round(k * DT * 1e6),
                utc_ns=UTC_NS + round(k * DT * 1e9),
                source=pb.SOURCE_SIMULATED,
                run=7,
            ),
            first_index=k,
            period_s=DT,
            axes=12,
            f_mps2=readings[k : k + size].ravel().tolist(),
        )
        for k in range(0, len(readings) - size + 1, size)
    ]


def through(pipeline: Pipeline, batches: list[pb.AccelBatch]) -> int:
    """Serialise all that the pipeline says; returns its bytes."""
    return sum(
        len(o.message.SerializeToString()) for one in batches for o in pipeline.on(ACCEL, one)
    )


def live(rounds: int, rate: list[str] | None, size: int) -> None:
    """One board: parsed batches in, serialised messages out."""
    settings = EstimatorSettings() if rate is None else EstimatorSettings(rate=rate)
    _, readings, _ = table()
    batches = messages("cube", readings, size)
    first, last = round(WARM_S / DT / size), round((WARM_S + SPAN_S) / DT / size)
    best = np.inf
    for _ in range(rounds):
        pipeline = Pipeline(settings)
        through(pipeline, batches[:first])
        began = time.process_time_ns()
        through(pipeline, batches[first:last])
        best = min(best, (time.process_time_ns() - began) / 1e3 / ((last - first) * size))
    say("live", estimators=settings.rate, samples_per_batch=size, us_per_sample=round(best, 1))


def cubes(count: int, rate: list[str] | None, size: int) -> None:
    """Many boards side by side, two seconds of turning, after the standstill."""
    _, readings, _ = table()
    streams = [messages(f"cube{k}", readings[: round(9.0 / DT)], size) for k in range(count)]
    settings = EstimatorSettings() if rate is None else EstimatorSettings(rate=rate)
    pipeline, start = Pipeline(settings), round(7.0 / DT / size)
    for k in range(start):
        for stream in streams:
            through(pipeline, stream[k : k + 1])
    began = time.process_time()
    for k in range(start, len(streams[0])):
        for stream in streams:
            through(pipeline, stream[k : k + 1])
    share = (time.process_time() - began) / 2.0
    say(
        "cubes",
        estimators=settings.rate,
        boards=count,
        hz=round(1.0 / DT),
        cpu_s_per_s=round(share, 3),
    )


def say(figure: str, **values: object) -> None:
    """One line."""
    print(json.dumps({"bench": "speed", "figure": figure} | values), flush=True)


def main() -> None:
    """All figures."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    batch(rounds)
    for size in (5, 10):
        live(rounds, ["products-ekf"], size)
        live(rounds, None, size)
    cubes(64, ["products-ekf"], 10)
    cubes(64, None, 10)


if __name__ == "__main__":
    main()
