"""An operator's orders to hold GNSS back: taken, published, and taken again from a recording (see
ins/mute.py).
"""

from estimator.devices.navigation import NavBoard
from inertial.navigation.mute import Mute, Mutes
from messages.contract import gyrofree_pb2 as pb


class MuteDesk:
    """What was ordered for each device."""

    def __init__(self) -> None:
        self._mutes: dict[str, Mutes] = {}

    def attend(self, device: str, board: NavBoard) -> NavBoard:
        """Let a device's navigation go by its orders; the board itself."""
        board.mutes = self._mutes.setdefault(device, Mutes())
        return board

    def order(
        self, command: pb.EstimatorCommand, board: NavBoard | None, clock_offset: float
    ) -> tuple[pb.Reply, pb.GnssMute | None]:
        """Carry out a command; the message says what it is about. clock_offset: UTC minus the
        board's clock, s.
        """
        device, seconds = command.device, command.seconds
        if board is None:
            return pb.Reply(
                ok=False, message=f"{device} does not navigate: it has sent no inertial samples"
            ), None
        try:
            order = board.mute(seconds)
        except ValueError as error:
            return pb.Reply(ok=False, message=str(error)), None
        text = (
            f"GNSS of {device} muted for {seconds:g} s"
            if seconds
            else f"GNSS of {device} is used again"
        )
        header = pb.Header(
            device=device, epoch=order.epoch, utc_ns=round((order.after + clock_offset) * 1e9)
        )
        message = pb.GnssMute(
            header=header, after_s=order.after, until_s=order.until, user=command.user
        )
        return pb.Reply(ok=True, message=text), message

    def take(self, message: pb.GnssMute) -> None:
        """An order that was given when a recording was made; before the fixes that it is about."""
        order = Mute(message.header.epoch, message.after_s, message.until_s)
        self._mutes.setdefault(message.header.device, Mutes()).add(order)
