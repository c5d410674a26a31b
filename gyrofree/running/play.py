"""`gyrofree play`: a log of real sensors as a board on a line."""

import logging
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from gateway.virtual import player
from gateway.virtual.board_link import PtyLink
from gateway.virtual.virtual_board import PLAYED, VirtualBoard

log = logging.getLogger(__name__)

LogError = player.PlayError


@dataclass(frozen=True)
class Options:
    """What `gyrofree play --link` was asked for."""

    log: Path
    gnss: Path | None
    speed: float
    loop: bool
    link: Path


def kind_of(path: Path, gnss: Path | None) -> str:
    """ "imu" or "cube"; raises LogError for a log that cannot be played."""
    return player.load(path, gnss).kind


def run(options: Options, stop: threading.Event) -> None:
    """Play the log; with `loop` start over, each time as a new boot of the board."""
    source = player.load(options.log, options.gnss)
    link = PtyLink(options.link)
    epoch = int(time.time()) & 0xFF
    try:
        while not stop.is_set():
            period = player.sample_period([row[0] for row in source.rows])
            board = VirtualBoard(
                link,
                PLAYED,
                epoch=epoch,
                sample_period_s=period,
                firmware=f"log {source.path.name}",
            )
            log.info(
                "playing %s, %.0f s at %g times real time",
                source.path,
                source.duration_s,
                options.speed,
            )
            board.run(source.items(), stop, speed=options.speed, wait_for_reader=True)
            log.info(
                "%d samples, %d frames built, %d dropped", board.samples, board.built, board.dropped
            )
            if not options.loop:
                return
            epoch = (epoch + 1) & 0xFF
    finally:
        link.close()
