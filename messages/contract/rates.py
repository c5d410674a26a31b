"""RateBatch, row by row: for recordings of version 1, and for whoever wants single samples.

A RateEstimate, as recordings of version 1 hold one per sample, has the field numbers of a RateBatch
and is therefore a batch of one; only zeros, which it does not spell out, are put in.
"""

from collections.abc import Iterator

from messages.contract import gyrofree_pb2 as pb

# Fields with a row per sample, and how many numbers that row has; 0: told by the length.
ROWS = {
    "omega_ib_b_radps": 3,
    "omega_covariance": 9,
    "alpha_b_radps2": 3,
    "f_b_mps2": 3,
    "q_nb": 4,
    "innovation": 0,
    "innovation_sigma": 0,
    "p_n_m": 3,
    "v_n_mps": 3,
    "bias": 0,
    "sight": 3,
    "bound_sigma_radps": 3,
}
NUMBERS = ("angle_z_rad", "nis", "nis_dof", "still")  # fields with one number per sample
ONLY_CORRECTED = ("innovation", "innovation_sigma")  # of meaning where nis_dof is not 0
BETWEEN = ("period_s", "index_step")  # how rows follow one another
WHOLE = ("estimator", "for_sequence", "innovation_unit", "calibration", "excluded_mask", "aid")


def count(batch: pb.RateBatch) -> int:
    """Rows of a batch."""
    return max(1, len(batch.omega_ib_b_radps) // ROWS["omega_ib_b_radps"])


def complete(batch: pb.RateBatch) -> pb.RateBatch:
    """The batch itself, with the zeros that a RateEstimate does not spell out."""
    n = count(batch)
    for name in NUMBERS:
        column = getattr(batch, name)
        if len(column) < n:
            column.extend([0] * (n - len(column)))
    return batch


def row(batch: pb.RateBatch, k: int) -> pb.RateEstimate:
    """Row k of a batch, -1 for the last, as a message of its own."""
    n = count(batch)
    k %= n
    one = pb.RateEstimate(header=batch.header, for_index=batch.for_index + k * batch.index_step)
    for name in WHOLE:
        setattr(one, name, getattr(batch, name))
    one.header.device_us += round(k * batch.period_s * 1e6)
    one.header.utc_ns += round(k * batch.period_s * 1e9)
    for name in NUMBERS:
        column = getattr(batch, name)
        if k < len(column):
            setattr(one, name, column[k])
    for name in ROWS:
        if one.nis_dof or name not in ONLY_CORRECTED:
            column = getattr(batch, name)
            width = len(column) // n
            getattr(one, name).extend(column[k * width : (k + 1) * width])
    if not any(one.bound_sigma_radps):
        del one.bound_sigma_radps[:]
    if any(one.sight):
        one.sight_reason = batch.sight_reason
    return one


def rows(batch: pb.RateBatch) -> Iterator[pb.RateEstimate]:
    """Every row of a batch as a message of its own."""
    return (row(batch, k) for k in range(count(batch)))
