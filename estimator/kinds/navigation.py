"""What navigation filters said, as messages: of a six-axis unit, and of a cube with GNSS.

Out: NavSolution and pose after a sample, Innovation for each fix that was used or refused, and
EstimatorStatus once per second of data.
"""

from estimator.convert.header import sample_header
from estimator.convert.navigation import innovation_message, nav_message, pose_message
from estimator.convert.samples import Samples
from estimator.convert.status import navigator_state
from estimator.devices.navigation import NavBoard, NavOutput
from estimator.kinds.common import Common
from estimator.output import Output
from inertial.navigation.solution import Correction, Solution
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ESTIMATOR, INNOVATION, NAV, POSE

Batch = pb.AccelBatch | pb.ImuBatch | pb.AdcBatch


def navigated(
    common: Common,
    batch: Batch,
    samples: Samples,
    board: NavBoard,
    said: list[NavOutput],
    names: list[str],
) -> list[Output]:
    """Messages about a batch; names: of the filters, as published."""
    device, out = batch.header.device, []
    for o in said:
        if isinstance(o.what, Correction):
            header = sample_header(batch.header, o.what.fix.t - samples.t_s[0])
            message = innovation_message(header, o.estimator, o.what)
            out.append(Output(INNOVATION, device, o.estimator, message))
        else:
            out += _solution(batch, board, o, o.what)
    if board.navigators and common.new_second(device, "nav", samples.t_s[-1]):
        header = sample_header(batch.header, (len(samples.t_s) - 1) * batch.period_s)
        for name in names:
            status = common.status(header, board.stream, name)
            status = navigator_state(status, board.navigators[name])
            out.append(Output(ESTIMATOR, device, name, status))
    return out


def _solution(batch: Batch, board: NavBoard, o: NavOutput, solution: Solution) -> list[Output]:
    device = batch.header.device
    header = sample_header(batch.header, o.row * batch.period_s)
    muted = board.muted(solution.t)
    nav = nav_message(header, batch, o.index, o.estimator, solution, muted)
    pose = pose_message(header, o.estimator, solution.p_ned, solution.q_nb)
    return [Output(NAV, device, o.estimator, nav), Output(POSE, device, o.estimator, pose)]
