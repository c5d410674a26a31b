"""Zenoh's own router, `zenohd`, in place of ours: its configuration, made by the same code.

It is a program of its own (the Rust crate of the same version as the Python package), which needs
no interpreter. It has two doors that a session of ours has not: its administration space, with
which anybody on the bus could read and change it, and plugins. Both are shut here.
"""

import json
import logging
import os
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

import zenoh

from messages.bus.faults import BusUnavailable
from messages.bus.session import open_client
from messages.bus.settings import BusSettings, configuration

SHUT = {
    "adminspace/permissions/read": False,
    "adminspace/permissions/write": False,
    "plugins_loading/search_dirs": [],  # it loads what is named, and nothing is
}
VERSION_S = 10.0
LOOK_S = 0.2
STOP_S = 5.0
SAYS = "warn"  # what of its log is shown, unless RUST_LOG says otherwise

log = logging.getLogger(__name__)


def zenohd_configuration(
    settings: BusSettings, access: dict[str, Any] | None = None, mesh: Iterable[str] = ()
) -> str:
    """What stands in its file (JSON, which is JSON5 too): the same listeners, certificates and
    rules as those of our router. Raises IdentityError without a certificate, zenoh.ZError for what
    Zenoh itself would not take.
    """
    flat = configuration(settings, "router", mesh) | SHUT
    if access is not None:
        flat["access_control"] = access
    tree: dict[str, Any] = {}
    for path, value in flat.items():
        *above, last = path.split("/")
        place = tree
        for name in above:
            place = place.setdefault(name, {})
        place[last] = value
    text = json.dumps(tree, indent=2) + "\n"
    zenoh.Config.from_json5(text)
    return text


def difference(program: Path) -> str:
    """In what its version differs from ours, in words; empty: in nothing. Raises OSError."""
    wanted = version("eclipse-zenoh")
    done = subprocess.run(
        [str(program), "--version"], capture_output=True, text=True, timeout=VERSION_S
    )
    said = (done.stdout + done.stderr).strip().splitlines()
    return "" if any(f"v{wanted} " in f"{line} " for line in said) else f"want zenohd {wanted}"


class Zenohd:
    """The program as a child of this process, and a session of ours that is its client. A context
    manager.
    """

    def __init__(
        self,
        settings: BusSettings,
        access: dict[str, Any] | None,
        mesh: Iterable[str],
        stop: threading.Event,
        before: Callable[[], None] | None = None,
    ) -> None:
        """settings: with `zenohd`, acting as the router. stop: ends the wait for it. before: is
        called in the child before it becomes the program. Raises what `zenohd_configuration` does.
        """
        self._program, self._settings, self._stop = settings.zenohd, settings, stop
        self._text, self._before = zenohd_configuration(settings, access, mesh), before
        self._process: subprocess.Popen | None = None

    def __enter__(self) -> Self:
        """Raises OSError where there is no such program, BusUnavailable where it ends at once."""
        if wrong := difference(self._program):
            log.warning("%s is of another version: %s", self._program, wrong)
        self._folder = tempfile.TemporaryDirectory(prefix="zenohd-")
        try:
            file = Path(self._folder.name) / "zenohd.json5"
            file.write_text(self._text)
            self._process = subprocess.Popen(
                [str(self._program), "--config", str(file)],
                stdin=subprocess.DEVNULL,
                env={"RUST_LOG": SAYS, "NO_COLOR": "1"} | os.environ,
                preexec_fn=self._before,
            )
            self.session = self._opened()
        except BaseException:
            self._end()
            raise
        return self

    def _opened(self) -> zenoh.Session:
        while True:
            self._look()
            try:
                return open_client(self._settings, self._stop, LOOK_S)
            except BusUnavailable:
                if self._stop.is_set():
                    raise

    @property
    def pid(self) -> int:
        """Of the program."""
        return self._process.pid

    def wait(self, look: Callable[[], object] = lambda: None) -> None:
        """Until `stop`; raises BusUnavailable where the program ends before. look(): is called a
        few times a second.
        """
        while not self._stop.wait(LOOK_S):
            self._look()
            look()

    def _look(self) -> None:
        code = self._process.poll()
        if code is not None:
            raise BusUnavailable(
                f"{self._program} ended with code {code}: is its port taken, or does a line above"
                " say why?"
            )

    def __exit__(self, *_: object) -> None:
        self.session.close()
        self._end()

    def _end(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._folder.cleanup()
