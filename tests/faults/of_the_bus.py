"""Faults of the bus: others who publish, ask and answer there."""

import random
import time

from support import hostile_bus

from faults.bench import Bench
from faults.scenario import Certified, Loss, Scenario, Status
from messages.bus.session import open_client
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, LINK

FOREIGN = 200  # messages of a foreign publisher
HOSTILE = 5000  # messages of any kind
SEED = 20_260_101


def foreign(bench: Bench) -> None:
    """Somebody else publishes samples and says that the line is fine, as the board's gateway."""
    with open_client(bench.bus) as session:
        for number in range(FOREIGN):
            batch = pb.AccelBatch()
            batch.CopyFrom(bench.watch.newest("accel"))
            batch.header.sequence += 1 + number % 3
            batch.first_index += 1
            batch.counts[:] = [4000] * len(batch.counts)
            session.put(ACCEL.key("gyrofree", "cube"), batch.SerializeToString())
            link = pb.LinkStatus()
            link.CopyFrom(bench.watch.newest("link"))
            link.header.sequence += 1
            link.message = "forged"
            session.put(LINK.key("gyrofree", "cube"), link.SerializeToString())
            time.sleep(0.005)


def malformed(bench: Bench) -> None:
    """Bytes that are no message, on every key that is known."""
    rng = random.Random(SEED)
    with open_client(bench.bus) as session:
        for _ in range(FOREIGN):
            for name in ("accel", "link", "rate/products-ekf", "alarm", "procedure"):
                session.put(f"gyrofree/cube/{name}", rng.randbytes(rng.choice((0, 1, 50, 4000))))
            time.sleep(0.005)


def hostile(bench: Bench) -> None:
    """Thousands of messages of every topic with any values, on keys of all kinds."""
    with open_client(bench.bus) as session:
        for key, payload in hostile_bus.messages(SEED, HOSTILE, "gyrofree"):
            try:
                session.put(key, payload)
            except Exception:  # a key that Zenoh itself refuses
                continue


def claimed(state) -> bool:
    return state.refused.get("claim", 0) >= FOREIGN


BUS = (
    Scenario(
        "foreign publisher",
        f"another program publishes {FOREIGN} samples and words on the line in the board's name",
        foreign,
        said=(Status("`refused[claim]` of the recorder", "states", claimed),),
        quick=True,
    ),
    Scenario(
        "malformed payload",
        f"{5 * FOREIGN} payloads of random bytes on keys that are known",
        malformed,
        said=(Status("`refused` of the recorder", "states", lambda state: bool(state.refused)),),
        quick=True,
    ),
    Scenario(
        "hostile peer",
        f"{HOSTILE} messages of every topic with any values, on keys of all kinds",
        hostile,
        Loss(complete=False),  # of what anybody may say, as notes, it cannot know whose they were
        (
            Status("`refused` of the recorder", "states", lambda state: bool(state.refused)),
            Certified("`refused` of the certificate", lambda counted: bool(counted.refused)),
        ),
    ),
)
