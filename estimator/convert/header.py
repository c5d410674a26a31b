"""What all messages of estimates have: a header made of their batch's, and arrays as lists."""

from typing import Any

import numpy as np

from messages.contract import gyrofree_pb2 as pb


def sample_header(first: pb.Header, offset_s: float) -> pb.Header:
    """Header of an estimate for the instant offset_s after the batch's first sample.

    It has no sequence: the publisher counts. Everything else follows from the input alone.
    """
    header = pb.Header()
    header.CopyFrom(first)
    header.sequence, header.late = 0, False
    header.device_us, header.utc_ns = moment(first.device_us, first.utc_ns, offset_s)
    return header


def moment(device_us: int, utc_ns: int, offset_s: float) -> tuple[int, int]:
    """device_us and utc_ns offset_s after those."""
    return max(0, device_us + round(offset_s * 1e6)), utc_ns + round(offset_s * 1e9)


def as_list(values: Any) -> list[float]:
    """Any array, row-major; None is empty."""
    return [] if values is None else np.asarray(values, dtype=np.float64).ravel().tolist()
