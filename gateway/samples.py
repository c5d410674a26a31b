"""Batches of samples as bus messages."""

from google.protobuf.message import Message

from firmware_protocol.frames import Acc12, Adc, Hello, Imu6
from gateway import analogue, convert
from gateway.batch import Batch
from messages import gyrofree_pb2 as pb
from messages.topics import ACCEL, ADC, IMU, Topic

Samples = Acc12 | Imu6 | Adc
KINDS: tuple[type, ...] = (Acc12, Imu6, Adc)


def adc_columns(
    payload: Adc, settings: analogue.AnalogueSettings
) -> tuple[tuple[list[int], list[float], list[float]], list[int]]:
    """(counts, specific force, rate), flat, and the inputs that the board does not send though settings want them."""
    counts = [count for row in payload.counts for count in row]
    lacking = analogue.missing(payload, settings)
    return (counts, *(([], []) if lacking else analogue.imu_of(payload, settings))), lacking


def adc_kind(payload: Adc, settings: analogue.AnalogueSettings) -> tuple[int, float]:
    """What frames of an analogue board must share to be joined: channels in a row, V per count."""
    return len(analogue.channels(payload.channel_mask)), analogue.volt_per_count(payload.vref_mv, settings.bits)


def messages_of(kind: type, batch: Batch, hello: Hello | None) -> list[tuple[Topic, Message]]:
    """What a batch of this kind of frame is on the bus, without headers."""
    common = dict(
        first_index=batch.first_index,
        period_s=batch.period_ns * 1e-9,
        lost_samples=batch.lost,
        frame_sequence=batch.frame_sequence,
        received_ns=batch.received_ns,
    )
    if kind is Acc12:
        counts, force = batch.columns
        return [(ACCEL, pb.AccelBatch(
            axes=len(counts) // batch.n, counts=counts, f_mps2=force, stale_mask=batch.stale_mask,
            axis_offset_s=convert.read_offsets(hello), **common,
        ))]  # fmt: skip
    if kind is Imu6:
        force, rate = batch.columns
        return [(IMU, pb.ImuBatch(f_b_mps2=force, omega_ib_b_radps=rate, **common))]
    counts, force, rate = batch.columns
    channels, volt = batch.kind
    said: list[tuple[Topic, Message]] = [
        (ADC, pb.AdcBatch(channels=channels, counts=counts, volt_per_count=volt, **common))
    ]
    if force:
        said.append((IMU, pb.ImuBatch(f_b_mps2=force, omega_ib_b_radps=rate, **common)))
    return said
