"""Parts of tests of procedures: how a run begins, and the other end of a table's line."""

import os
import threading
import time
import tty

STILL = 'title = "a"\n[[steps]]\nkind = "still"\nseconds = 1\n'


def start(**more) -> dict:
    whole = {"run": "20260101T000000-1", "procedure": "x", "toml": STILL, "device": "cube"}
    return whole | {"unit": "SN", "operator": "anna", "own_session": False} | more


class Answers:
    """The other end of a serial line; `answer` makes the reply to each line, `pause_s` later."""

    pause_s = 0.0

    def __init__(self, answer) -> None:
        self.fd, slave = os.openpty()
        tty.setraw(slave)
        self.path, self._keep, self.lines = os.ttyname(slave), slave, []
        threading.Thread(target=self._serve, args=(answer,), daemon=True).start()

    def _serve(self, answer) -> None:
        said = b""
        while True:
            try:
                said += os.read(self.fd, 100)
            except OSError:
                return
            while b"\n" in said:
                line, said = said.split(b"\n", 1)
                self.lines.append(line.decode())
                reply = answer(line.decode())
                time.sleep(self.pause_s)
                if reply is not None:
                    os.write(self.fd, reply.encode() + b"\n")
