"""Rate estimates of one batch as a message, and what messages about a board have in common. Part
of the shell: knows messages.
"""

from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform

from estimator.convert.header import sample_header
from estimator.devices.rate import RateOutput
from inertial.rate.batch import TACHOMETER, RateColumns
from messages.contract import gyrofree_pb2 as pb


def rate_batch(batch: pb.AccelBatch, card: str, said: RateOutput) -> pb.RateBatch:
    """What an estimator says of samples of a batch, as published; the publisher counts the
    sequence. card: id of the calibration file in use, empty for none.
    """
    columns = said.columns
    nis_dof, sight = columns.nis_dof.tolist(), columns.sight.ravel().tolist()
    message = pb.RateBatch(
        header=sample_header(batch.header, said.row * batch.period_s),
        estimator=said.estimator,
        for_sequence=batch.header.sequence,
        for_index=said.index,
        omega_ib_b_radps=columns.omega_b.ravel().tolist(),
        omega_covariance=columns.P.ravel().tolist(),
        alpha_b_radps2=columns.alpha_b.ravel().tolist(),
        f_b_mps2=columns.f_b.ravel().tolist(),
        q_nb=columns.q_nb.ravel().tolist(),
        angle_z_rad=columns.angle_z.tolist(),
        nis=columns.nis.tolist(),
        nis_dof=nis_dof,
        still=columns.still.tolist(),
        p_n_m=columns.p_n.ravel().tolist(),
        v_n_mps=columns.v_n.ravel().tolist(),
        bias=columns.bias.ravel().tolist(),
        innovation_unit=columns.innovation_unit,
        sight=sight,
        sight_reason=_sight_reason(columns) if any(sight) else "",
        calibration=card,
        excluded_mask=columns.excluded,
        aid=TACHOMETER if any(columns.aided.tolist()) else "",
        period_s=said.step * batch.period_s,
        index_step=said.step,
    )
    if any(nis_dof):
        message.innovation.extend(columns.innovation.ravel().tolist())
        message.innovation_sigma.extend(columns.innovation_sigma.ravel().tolist())
    bound_sigma = columns.bound_sigma.ravel().tolist()
    if any(bound_sigma):
        message.bound_sigma_radps.extend(bound_sigma)
    return message


def _sight_reason(columns: RateColumns) -> str:
    """Why the last sample that has a component which is not valid has it; there is one."""
    unseen = np.flatnonzero(columns.sight.any(axis=1))
    return columns.sight_reason(int(unseen[-1]))


class BoardMessages:
    """What the messages about one board have in common, put into bytes once."""

    def __init__(self, device: str, layout: Any) -> None:
        self._device = device
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
