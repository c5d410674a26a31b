"""`gyrofree play`: a log of real sensors as a board on a line."""

import hashlib
import logging
import threading
import time
import unicodedata
from dataclasses import dataclass
from pathlib import Path

from gateway.virtual.board_link import PtyLink
from gateway.virtual.virtual_board import PLAYED, VirtualBoard
from gyrofree.running.log_items import items_of
from logs.board_log import BoardLog, read_board_log

log = logging.getLogger(__name__)

NAME = 16  # characters of a log's name that a board's HELLO has room for


@dataclass(frozen=True)
class Options:
    """What `gyrofree play --link` was asked for."""

    log: Path
    gnss: Path | None
    speed: float
    loop: bool
    link: Path
    units_as_named: bool = False


def board_name(file: str) -> str:
    """A file's name as a board can say it: ASCII, at most NAME characters, and another one for
    every file. One that had to be changed ends in ~ and a number made of the whole name.
    """
    whole = unicodedata.normalize("NFC", file)
    plain = unicodedata.normalize("NFKD", whole).encode("ascii", "ignore").decode()
    plain = "".join(c if c.isprintable() else "_" for c in plain)
    if plain == file and len(plain) <= NAME:
        return plain
    digest = hashlib.sha256(whole.encode("utf-8", "surrogatepass")).hexdigest()
    return f"{plain[: NAME - 7]}~{digest[:6]}"


def kind_of(path: Path, gnss: Path | None, units_as_named: bool = False) -> str:
    """ "imu" or "cube"; raises LogError, OSError for a log that cannot be played."""
    return read_board_log(path, gnss, units_as_named).kind


def run(options: Options, stop: threading.Event) -> None:
    """Play the log; with `loop` start over, each time as a new boot of the board."""
    source: BoardLog = read_board_log(options.log, options.gnss, options.units_as_named)
    for note in source.notes:
        log.warning("%s", note)
    name = board_name(source.path.name)
    if name != source.path.name:
        log.info("the board calls itself 'log %s': it has %d characters for a name", name, NAME)
    link = PtyLink(options.link)
    epoch = int(time.time()) & 0xFF
    try:
        while not stop.is_set():
            board = VirtualBoard(
                link,
                PLAYED,
                epoch=epoch,
                sample_period_s=source.timing.period_s,
                firmware=f"log {name}",
            )
            log.info(
                "playing %s, %.0f s at %g times real time",
                source.path,
                source.duration_s,
                options.speed,
            )
            board.run(items_of(source), stop, speed=options.speed, wait_for_reader=True)
            log.info(
                "%d of %d samples played, %d frames built, %d dropped",
                board.samples,
                len(source.t_s),
                board.built,
                board.dropped,
            )
            if not options.loop:
                return
            epoch = (epoch + 1) & 0xFF
    finally:
        link.close()
