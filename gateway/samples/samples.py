"""Batches of samples as bus messages."""

import logging

from google.protobuf.message import Message

from firmware_protocol.frames import Acc12, Adc, Hello, Imu6
from gateway.samples import analogue, convert
from gateway.samples.batch import Batch
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, ADC, IMU, Topic

log = logging.getLogger(__name__)

Samples = Acc12 | Imu6 | Adc
KINDS: tuple[type, ...] = (Acc12, Imu6, Adc)


class Force:
    """Columns of ACC12 frames; knows the sample before, for boards that read their axes one after
    the other.
    """

    def __init__(self) -> None:
        self._last_row: list[float] | None = None  # specific force of the newest sample, as read

    def columns(
        self, payload: Acc12, hello: Hello | None, lost: int
    ) -> tuple[list[int], list[float]]:
        """Counts as read, and specific force (m/s²) brought to the samples' instants; lost: samples
        before these.
        """
        counts = [count for row in payload.counts for count in row]
        force = convert.specific_force(counts, convert.axis_scales(hello))
        before, self._last_row = None if lost else self._last_row, force[-12:]
        offsets = convert.read_offsets(hello)
        if offsets:
            force = convert.at_the_instant(force, before, offsets, payload.period_ns * 1e-9)
        return counts, force


class Analogue:
    """Columns of ADC frames."""

    def __init__(self, name: str, settings: analogue.AnalogueSettings) -> None:
        self._name, self._settings = name, settings
        self._lacking: list[
            int
        ] = []  # inputs that the board does not send though settings want them

    def columns(self, payload: Adc) -> tuple[list[int], list[float], list[float]]:
        """(counts, specific force, rate), flat; the last two empty while inputs are missing, which
        is said once.
        """
        counts = [count for row in payload.counts for count in row]
        lacking = analogue.missing(payload, self._settings)
        if lacking and lacking != self._lacking:
            log.warning(
                "%s: no counts of inputs %s: see [gateway.devices.analogue]", self._name, lacking
            )
        self._lacking = lacking
        force, rate = ([], []) if lacking else analogue.imu_of(payload, self._settings)
        return counts, force, rate


def adc_kind(
    payload: Adc, settings: analogue.AnalogueSettings
) -> tuple[int, float, tuple[float, ...]]:
    """What frames of an analogue board must share to be joined: inputs, V per count, figures of the
    sensors.
    """
    volt = analogue.volt_per_count(payload.vref_mv, settings.bits)
    return payload.channel_mask, volt, analogue.figures(settings)


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
        return [
            (
                ACCEL,
                pb.AccelBatch(
                    axes=len(counts) // batch.n,
                    counts=counts,
                    f_mps2=force,
                    stale_mask=batch.stale_mask,
                    axis_offset_s=convert.read_offsets(hello),
                    **common,
                ),
            )
        ]
    if kind is Imu6:
        force, rate = batch.columns
        return [(IMU, pb.ImuBatch(f_b_mps2=force, omega_ib_b_radps=rate, **common))]
    counts, force, rate = batch.columns
    mask, volt, (zero_g, per_mps2, zero_rate, per_radps) = batch.kind
    said: list[tuple[Topic, Message]] = [
        (
            ADC,
            pb.AdcBatch(
                channels=len(analogue.channels(mask)),
                counts=counts,
                volt_per_count=volt,
                channel_mask=mask,
                zero_g_v=zero_g,
                accel_v_per_mps2=per_mps2,
                zero_rate_v=zero_rate,
                gyro_v_per_radps=per_radps,
                **common,
            ),
        )
    ]
    if force:
        said.append((IMU, pb.ImuBatch(f_b_mps2=force, omega_ib_b_radps=rate, **common)))
    return said
