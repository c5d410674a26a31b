"""Sessions as a gateway sends them, and all that the estimators publish on them, byte for byte.

As a program it runs the sessions of one file and writes what was published to another, so that two
processes that see different processors can be compared.
"""

import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from estimator.service import Pipeline
from estimator.settings import EstimatorSettings
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import TOPICS

ORDER = "order"  # stands for the topic of an EstimatorCommand
TYPES = {topic.name: topic.type for topic in TOPICS} | {ORDER: pb.EstimatorCommand}
BY_NAME = {topic.name: topic for topic in TOPICS}


class Session(NamedTuple):
    """What a pipeline is given."""

    settings: dict[str, Any]
    items: list[tuple[str, bytes]]  # topic and payload, in the order of the bus


class Published(NamedTuple):
    """One message that a pipeline said."""

    topic: str
    estimator: str
    payload: bytes


def published(session: Session) -> Iterator[Published]:
    """Everything that a pipeline says, but for the time that it took."""
    pipeline = Pipeline(EstimatorSettings(**session.settings))
    for name, payload in session.items:
        message = TYPES[name].FromString(payload)
        if name == ORDER:
            reply, outputs = pipeline.order(message)
            assert reply.ok, reply.message
        else:
            outputs = pipeline.on(BY_NAME[name], message)
        for topic, _, estimator, said in outputs:
            if isinstance(said, pb.EstimatorStatus):
                said.ClearField("us_per_sample")
            yield Published(topic.name, estimator, said.SerializeToString(deterministic=True))


def main(inputs: Path, outputs: Path) -> None:
    """Run every session of the file `inputs`; both files are pickled dictionaries by name."""
    sessions = pickle.loads(inputs.read_bytes())
    said = {name: list(map(tuple, published(Session(*s)))) for name, s in sessions.items()}
    outputs.write_bytes(pickle.dumps(said))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
