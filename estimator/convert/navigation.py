"""Messages out: navigation solutions, their poses, and what a fix did to them."""

import math
from collections.abc import Iterable

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform

from estimator.convert.header import as_list
from inertial.navigation.fuzzy import MEMBERSHIPS, memberships
from inertial.navigation.solution import (
    HEADING,
    INNOVATIONS,
    Correction,
    HorizonChoice,
    Solution,
)
from messages.contract import gyrofree_pb2 as pb


def pose_message(
    header: pb.Header, name: str, p_n_m: Iterable[float], q_nb: Iterable[float]
) -> FrameTransform:
    """Body against n as any viewer draws it: parent <device>/n, child <device>/<estimator>."""
    message = FrameTransform(
        parent_frame_id=f"{header.device}/n", child_frame_id=f"{header.device}/{name}"
    )
    message.timestamp.seconds, message.timestamp.nanos = divmod(header.utc_ns, 10**9)
    t, q = message.translation, message.rotation
    # a viewer cannot draw what nobody knows: it gets the origin's
    t.x, t.y, t.z = (float(p) if math.isfinite(p) else 0.0 for p in p_n_m)
    q.w, q.x, q.y, q.z = map(float, q_nb)
    return message


def nav_message(
    header: pb.Header,
    batch: pb.ImuBatch | pb.AccelBatch,
    index: int,
    name: str,
    s: Solution,
    muted: bool = False,
) -> pb.NavSolution:
    """Solution as published."""
    return pb.NavSolution(
        header=header,
        estimator=name,
        for_sequence=batch.header.sequence,
        for_index=index,
        mode=int(s.mode),
        latitude_deg=math.degrees(s.latitude),
        longitude_deg=math.degrees(s.longitude),
        height_m=s.height,
        p_ned_m=as_list(s.p_ned) if math.isfinite(s.latitude) else [],
        v_n_mps=as_list(s.v_n),
        q_nb=as_list(s.q_nb),
        bias_f_b_mps2=as_list(s.bias_f_b),
        bias_omega_b_radps=as_list(s.bias_omega_b),
        sigma=as_list(s.sigma),
        position_covariance=as_list(s.position_covariance),
        origin_latitude_deg=math.degrees(s.origin[0]),
        origin_longitude_deg=math.degrees(s.origin[1]),
        origin_height_m=s.origin[2],
        fix_age_s=s.fix_age,
        horizon=None if s.horizon is None else horizon_message(s.horizon),
        alignment=s.alignment,
        gnss_muted=muted,
        height_reference=_reference(s),
    )


def _reference(s: Solution) -> int:
    if not math.isfinite(s.height):
        return pb.HEIGHT_REFERENCE_UNKNOWN
    return pb.HEIGHT_REFERENCE_SEA_LEVEL if s.datum else pb.HEIGHT_REFERENCE_ELLIPSOID


def horizon_message(h: HorizonChoice) -> pb.Horizon:
    """The horizon as published; a fixed one has no memberships."""
    message = pb.Horizon(n=h.n, crisp=h.crisp)
    if h.inputs is not None:
        message.inputs[:] = h.inputs
        message.membership_name[:] = MEMBERSHIPS
        message.membership[:] = memberships(*h.inputs)
    return message


def innovation_message(header: pb.Header, name: str, c: Correction) -> pb.Innovation:
    """Correction as published; a withheld fix is a reference the filter did not see."""
    return pb.Innovation(
        header=header,
        estimator=name,
        for_sequence=c.fix.key,
        name=[*INNOVATIONS[: len(c.values) // 3 * 3], *[HEADING] * (len(c.values) % 3)],
        value=as_list(c.values),
        sigma=as_list(c.sigma),
        nis=c.nis,
        dof=sum(map(math.isfinite, c.values)),
        accepted=c.accepted,
        error_to_reference=as_list(c.error_ned) if c.fix.withheld else [],
        reason=c.reason,
        weight=c.weight,
        prediction_error=as_list(c.prediction_error),
        residual=as_list(c.residual),
    )
