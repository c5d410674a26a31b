"""What a foreign, broken or hostile program may put on the bus, from a seed: (key, payload).

Every topic's key; keys with capitals, markup, too many parts; well-formed messages with extreme
values; messages of another topic; random bytes; long lists; now and then a very long payload.
"""

import math
import random
import struct
from collections.abc import Iterator

from google.protobuf.descriptor import FieldDescriptor as F
from google.protobuf.message import Message

from messages.contract import gyrofree_pb2 as pb
from messages.contract.checks import MESSAGE_BYTES
from messages.contract.topics import TOPICS

NAMES = ("cube", "car", "Cube", "x" * 40, "<img src=x>", "ümlaut", "a b", "1st", "a", "recorder")
FLOATS = (0.0, -0.0, 1.0, -1.0, 9.81, 1e-300, 1e300, -1e300, 1e9, math.nan, math.inf, -math.inf)
WHOLE = (0, 1, 2, 12, 63, 64, 65, 255, 1000, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**53, 2**55)
UTC_NS = 1_700_000_000 * 10**9
SPANS = {
    F.CPPTYPE_INT32: (-(2**31), 2**31 - 1),
    F.CPPTYPE_INT64: (-(2**63), 2**63 - 1),
    F.CPPTYPE_UINT32: (0, 2**32 - 1),
    F.CPPTYPE_UINT64: (0, 2**64 - 1),
    F.CPPTYPE_BOOL: (0, 1),
    F.CPPTYPE_ENUM: (-(2**31), 2**31 - 1),
}


def value(rng: random.Random, field: F) -> object:
    """One value that fits the field's type, and may be all else than sound."""
    if field.type == F.TYPE_BYTES:
        return rng.randbytes(rng.choice((0, 1, 100)))
    if field.cpp_type == F.CPPTYPE_STRING:
        return rng.choice((*NAMES, "", "</script>", "\u202e\x00\x1b[2J", "y" * 5000))
    if field.cpp_type in (F.CPPTYPE_DOUBLE, F.CPPTYPE_FLOAT):
        return rng.choice((*FLOATS, rng.gauss(0.0, 10.0)))
    low, high = SPANS[field.cpp_type]
    if rng.random() < 0.4:
        return rng.randint(low, high)
    return min(high, max(low, rng.choice(WHOLE) * rng.choice((1, 1, 1, -1))))


def fill(rng: random.Random, message: Message, depth: int = 0) -> Message:
    """Random fields of a message."""
    often = rng.random()
    for field in message.DESCRIPTOR.fields:
        if field.name == "header" and rng.random() < 0.7:
            message.header.CopyFrom(header(rng))
            continue
        if rng.random() > often or field.message_type is not None and depth > 2:
            continue
        target = getattr(message, field.name)
        if field.message_type is not None and field.message_type.GetOptions().map_entry:
            for k in range(rng.choice((0, 1, 3, 2000))):
                target[f"k{k}"] = k
        elif field.is_repeated and field.message_type is not None:
            for _ in range(rng.choice((0, 1, 3))):
                fill(rng, target.add(), depth + 1)
        elif field.is_repeated:
            n = rng.choice((0, 1, 2, 3, 4, 6, 9, 12, 36, 120, rng.choice((64, 5000, 20_000))))
            one = value(rng, field)
            target.extend(one for _ in range(n))
            if n and rng.random() < 0.3:
                target[rng.randrange(n)] = value(rng, field)
        elif field.message_type is not None:
            target.SetInParent()
            fill(rng, target, depth + 1)
        else:
            setattr(message, field.name, value(rng, field))
    return message


def header(rng: random.Random) -> pb.Header:
    """A header that may be believed, at some time of some boot."""
    t = rng.choice((rng.random() * 100.0, 10.0 ** rng.uniform(0, 8)))
    return pb.Header(
        device=rng.choice(("cube", "car", "")),
        sequence=rng.choice((rng.randrange(1, 1000), rng.randrange(1, 2**40))),
        epoch=rng.choice((0, 1, 2**32 - 1)),
        device_us=int(t * 1e6),
        utc_ns=rng.choice((UTC_NS + int(t * 1e9), rng.randrange(4 * 10**18))),
        source=rng.choice((0, 1, 2)),
        run=rng.choice((1, 7, UTC_NS, 2**62)),
    )


def message(rng: random.Random) -> Message:
    """A message of any topic."""
    return fill(rng, rng.choice(TOPICS).type())


def payload(rng: random.Random, type_: type[Message]) -> bytes:
    """Bytes that come on a key of this type."""
    dice = rng.random()
    if dice < 0.15:
        return rng.randbytes(rng.choice((0, 1, 2, 10, 200)))
    if dice < 0.25:
        return message(rng).SerializeToString()
    if dice < 0.27:  # a length that runs over the end, a header that does not stand first
        return struct.pack("<BB", 0x0A, 0xFF) * rng.randrange(1, 9)
    if dice < 0.2701:
        return bytes(MESSAGE_BYTES + 1)
    if dice < 0.35:
        whole = fill(rng, type_()).SerializeToString()
        return whole[: rng.randrange(len(whole) + 1)]
    return fill(rng, type_()).SerializeToString()


def key(rng: random.Random, prefix: str, topic: str, per_estimator: bool) -> str:
    """A key of this topic, or something like it."""
    device = rng.choice(NAMES[:2]) if rng.random() < 0.7 else rng.choice(NAMES)
    if rng.random() < 0.05:
        device = f"flood{rng.randrange(100_000)}"
    parts = [prefix, device, topic]
    if per_estimator != (rng.random() < 0.05):
        one = rng.choice(("kf", "products-ekf", "huber-nhc", f"e{rng.randrange(10_000)}"))
        parts.append(one if rng.random() < 0.8 else rng.choice(NAMES))
    if rng.random() < 0.03:
        parts = parts[: rng.randrange(1, 4)] + ["more"] * rng.randrange(3)
    return "/".join(parts)


def messages(seed: int, count: int, prefix: str = "t") -> Iterator[tuple[str, bytes]]:
    """`count` of them; the same for the same seed."""
    rng = random.Random(seed)
    for _ in range(count):
        topic = rng.choice(TOPICS)
        at = key(rng, prefix, topic.name, topic.per_estimator)
        yield at, payload(rng, topic.type)
