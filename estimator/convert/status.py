"""Messages out: health of one estimator."""

from typing import Any

from estimator.convert.header import as_list
from estimator.stream import Stream
from messages.contract import gyrofree_pb2 as pb


def status_message(
    header: pb.Header, stream: Stream, name: str, us: float, version: str
) -> pb.EstimatorStatus:
    """Health of one estimator, without its state; us: measured time per sample."""
    return pb.EstimatorStatus(
        header=header,
        estimator=name,
        samples=stream.samples,
        gaps=stream.gaps,
        missing_samples=stream.missing,
        us_per_sample=us,
        version=version,
    )


def navigator_state(status: pb.EstimatorStatus, navigator: Any) -> pb.EstimatorStatus:
    """The status with what a navigator does and has counted."""
    status.state = "navigating" if navigator.navigating else navigator.text
    status.message = ", ".join(
        f"fixes {what} {count}" for what, count in navigator.counts.items() if count
    )
    return status


def rate_state(status: pb.EstimatorStatus, state: Any) -> pb.EstimatorStatus:
    """The status with what a rate estimator does; state: its newest RateState."""
    status.state = state.phase or ("standing still" if state.still else "turning")
    bias = as_list(state.bias)
    if len(bias) >= 6:
        status.bias_alpha_radps2[:] = bias[:3]
        status.bias_f_b_mps2[:] = bias[3:6]
    return status
