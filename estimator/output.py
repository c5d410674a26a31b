"""One message to publish, and what all kinds of devices say at the same times."""

from typing import NamedTuple

from google.protobuf.message import Message

from messages.contract.topics import Topic


class Output(NamedTuple):
    """One message to publish."""

    topic: Topic
    device: str
    estimator: str
    message: Message
