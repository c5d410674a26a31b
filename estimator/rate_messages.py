"""Rate estimates of one batch as messages. Part of the shell: knows messages.

This runs for every sample. What the samples of a batch share is put into bytes once; what the
filter wrote into a row goes from there into the message as it stands.
"""

from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform

from estimator.convert.header import moment
from estimator.packed import Doubles
from messages.contract import gyrofree_pb2 as pb

MOST_SHARED = 64  # combinations of what few samples change; a clock that is adjusted makes new ones
_NONE = np.zeros(0)
_ARRAYS = Doubles(
    pb.RateEstimate,
    "omega_ib_b_radps",
    "omega_covariance",
    "alpha_b_radps2",
    "f_b_mps2",
    "q_nb",
    "innovation",
    "innovation_sigma",
    "p_n_m",
    "v_n_mps",
    "bias",
    "bound_sigma_radps",
)


class RateMessages:
    """Messages about the samples of one batch."""

    def __init__(
        self, batch: pb.AccelBatch, card: str, shared: dict[tuple[Any, ...], bytes] | None = None
    ) -> None:
        """card: id of the calibration file in use, empty for none; shared: what batches of one
        board have in common.
        """
        first = batch.header
        self._header, self._period_s, self._sequence = first, batch.period_s, first.sequence
        self._device_us, self._utc_ns = first.device_us, first.utc_ns
        self._of_batch = (
            first.device,
            first.epoch,
            first.utc_sigma_s,
            first.source,
            first.run,
            card,
        )
        self._shared = {} if shared is None else shared

    def estimate(self, row: int, index: int, name: str, state: Any) -> pb.RateEstimate:
        """RateState after sample `index`, which is `row` of the batch, as
        published.
        """
        key = (
            name,
            state.still,
            state.nis_dof,
            state.sight,
            state.excluded,
            state.aid,
            self._of_batch,
        )
        shared = self._shared.get(key)
        if shared is None:
            if len(self._shared) >= MOST_SHARED:
                self._shared.clear()
            shared = self._shared[key] = self._share(name, state)
        message = pb.RateEstimate()
        message.MergeFromString(shared + self._numbers(state))
        header = message.header
        header.device_us, header.utc_ns = moment(
            self._device_us, self._utc_ns, row * self._period_s
        )
        message.for_sequence, message.for_index = self._sequence, index
        if state.sight_reason:
            message.sight_reason = state.sight_reason
        return message

    def _share(self, name: str, state: Any) -> bytes:
        """Fields that have few values; the publisher counts the sequence."""
        message = pb.RateEstimate(
            header=self._header,
            estimator=name,
            nis_dof=state.nis_dof,
            still=state.still,
            innovation_unit=state.innovation_unit,
            sight=state.sight,
            calibration=self._of_batch[-1],
            excluded_mask=state.excluded,
            aid=state.aid,
        )
        message.header.sequence, message.header.late = 0, False
        return message.SerializeToString()

    def _numbers(self, state: Any) -> bytes:
        bound = state.bound_sigma
        message = pb.RateEstimate(angle_z_rad=state.angle_z, nis=state.nis)
        return message.SerializeToString() + _ARRAYS.wire(
            state.omega_b,
            state.P,
            state.alpha_b,
            state.f_b,
            state.q_nb,
            state.innovation,
            state.innovation_sigma,
            state.p_n,
            state.v_n,
            state.bias,
            _NONE if bound is None else bound,
        )


class BoardMessages:
    """What the messages about one board have in common, put into bytes once."""

    def __init__(self, device: str, layout: Any) -> None:
        self._device = device
        self.shared: dict[tuple[Any, ...], bytes] = {}  # of RateMessages
        self._poses: dict[str, bytes] = {}
        axes = pb.AxisHealth(layout=layout.name, scale_m=layout.scale_m)
        for name, position, direction in zip(
            layout.axis_names, layout.r_b, layout.theta_b, strict=True
        ):
            axes.axes.add(name=name, position_b_m=position.tolist(), direction_b=direction.tolist())
        self._axes = axes.SerializeToString()

    def pose(self, name: str, utc_ns: int, q_nb: Any) -> FrameTransform:
        """Body against n by one estimator, as any viewer draws it: the board turns and stays where
        it is.
        """
        shared = self._poses.get(name)
        if shared is None:
            still = FrameTransform(
                parent_frame_id=f"{self._device}/n", child_frame_id=f"{self._device}/{name}"
            )
            still.translation.SetInParent()
            shared = self._poses[name] = still.SerializeToString()
        message = FrameTransform.FromString(shared)
        message.timestamp.seconds, message.timestamp.nanos = divmod(utc_ns, 10**9)
        q = message.rotation
        q.w, q.x, q.y, q.z = q_nb.tolist()
        return message

    def axes(self, header: pb.Header, monitor: Any, now_s: float) -> pb.AxisHealth:
        """HealthMonitor as published; header is for the sample at now_s (s, board's clock)."""
        newest, message = monitor.newest, pb.AxisHealth.FromString(self._axes)
        message.header.CopyFrom(header)
        message.chi2, message.dof, message.message = (
            newest.nis,
            max(0, newest.degrees - 6),
            monitor.message,
        )
        told = zip(
            message.axes,
            monitor.faults,
            newest.residual.tolist(),
            newest.sigma.tolist(),
            strict=True,
        )
        for axis, fault, residual, sigma in told:
            axis.state, axis.excluded, axis.text = fault.state, fault.excluded, fault.text
            axis.residual_mps2, axis.residual_sigma_mps2 = residual, sigma
            axis.since_utc_ns = header.utc_ns + round((fault.since_s - now_s) * 1e9)
        return message
