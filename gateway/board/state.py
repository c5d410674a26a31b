"""What the newest frames say of the board itself."""

from dataclasses import dataclass

from firmware_protocol.frames import Hello, Status
from gateway.samples.convert import source


@dataclass
class BoardState:
    """Of one boot; `restart` begins another."""

    epoch: int | None = None  # boot counter; None before the first frame
    flags: int = 0  # of the newest frame
    # None until this boot has said them: then only the frames' own flags tell what they come from
    hello: Hello | None = None
    status: Status | None = None

    @property
    def source(self) -> int:
        """Where the frames come from, as messages say it (pb.Source)."""
        return source(self.hello, self.flags)

    def restart(self, epoch: int) -> None:
        """The board has booted."""
        self.epoch = epoch
        self.hello = self.status = None
