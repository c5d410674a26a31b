"""Messages out: tilt of a six-axis board."""

from typing import Any

from estimator.convert.header import as_list
from messages.contract import gyrofree_pb2 as pb


def attitude_message(
    header: pb.Header, batch: pb.ImuBatch, index: int, name: str, state: Any
) -> pb.AttitudeEstimate:
    """AttitudeState as published; no filter of that kind knows north."""
    return pb.AttitudeEstimate(
        header=header,
        estimator=name,
        for_sequence=batch.header.sequence,
        for_index=index,
        q_nb=as_list(state.q_nb),
        inclination_sigma_rad=float(state.inclination_sigma),
        bias_omega_b_radps=as_list(state.bias_omega_b),
        resting=bool(state.resting),
        heading_known=False,
    )
