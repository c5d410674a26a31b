"""`gyrofree play`: a log of real sensors as a board on a line."""

import logging
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from gateway.virtual.board_link import PtyLink
from gateway.virtual.virtual_board import PLAYED, VirtualBoard
from gyrofree.running.log_items import items_of
from logs.board_log import BoardLog, read_board_log

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Options:
    """What `gyrofree play --link` was asked for."""

    log: Path
    gnss: Path | None
    speed: float
    loop: bool
    link: Path
    units_as_named: bool = False


def kind_of(path: Path, gnss: Path | None, units_as_named: bool = False) -> str:
    """ "imu" or "cube"; raises LogError, OSError for a log that cannot be played."""
    return read_board_log(path, gnss, units_as_named).kind


def run(options: Options, stop: threading.Event) -> None:
    """Play the log; with `loop` start over, each time as a new boot of the board."""
    source: BoardLog = read_board_log(options.log, options.gnss, options.units_as_named)
    for note in source.notes:
        log.warning("%s", note)
    link = PtyLink(options.link)
    epoch = int(time.time()) & 0xFF
    try:
        while not stop.is_set():
            board = VirtualBoard(
                link,
                PLAYED,
                epoch=epoch,
                sample_period_s=source.timing.period_s,
                firmware=f"log {source.path.name}",
            )
            log.info(
                "playing %s, %.0f s at %g times real time",
                source.path,
                source.duration_s,
                options.speed,
            )
            board.run(items_of(source), stop, speed=options.speed, wait_for_reader=True)
            log.info(
                "%d samples, %d frames built, %d dropped", board.samples, board.built, board.dropped
            )
            if not options.loop:
                return
            epoch = (epoch + 1) & 0xFF
    finally:
        link.close()
