"""The whole stack while its wall clock is set back and forward, and its gateway is stopped."""

import json
import os
import re
import signal
import time

import numpy as np
from support.stack import RunningDemo
from support.waiting import until
from support.wall_clock import YEAR_S, WallClock

from messages.bus.session import BusSettings, open_client, subscribe
from messages.contract.topics import ACCEL, BOARD, LINK, STATUS
from sessions.export.table import Selection, tables

STOPPED_S = 4.0  # shorter than a lease: nobody takes its place


def test_a_session_over_a_clock_that_is_set_and_a_gateway_that_is_stopped(tmp_path):
    wall = WallClock(tmp_path / "wall")
    samples, links, states, boards = [], [], [], []
    with RunningDemo(tmp_path, "--record", environment=wall.environment) as demo:
        session = open_client(BusSettings(router=f"tcp/127.0.0.1:{demo.bus_port}"))
        real = time.time() - time.monotonic()
        keep = [
            subscribe(
                session,
                ACCEL,
                "gyrofree",
                lambda _, m: samples.append((time.monotonic() + real, m.header)),
            ),
            subscribe(session, LINK, "gyrofree", lambda _, m: links.append(m)),
            subscribe(session, STATUS, "gyrofree", lambda _, m: states.append(m)),
            subscribe(session, BOARD, "gyrofree", lambda _, m: boards.append(m)),
        ]
        until(lambda: links and states and states[-1].messages > 500, "recording")
        wall.set(-YEAR_S)
        until(lambda: links[-1].clock_offset_s < -0.9 * YEAR_S, "step back in the link's status")
        until(lambda: states[-1].clock_steps == 1, "step back in the recorder's status")
        wall.set(0.0)
        until(lambda: abs(links[-1].clock_offset_s) < 1.0, "step forward")
        until(lambda: states[-1].clock_steps == 2, "step forward in the recorder's status")
        until(lambda: links[-1].clock_window_s > 12.0, "a clock that is known")
        gateway = demo.children()["gateway"].pid
        boards.clear()
        os.kill(gateway, signal.SIGSTOP)
        time.sleep(STOPPED_S)
        went_on = len(samples)
        os.kill(gateway, signal.SIGCONT)
        until(lambda: links[-1].stops == 1, "word that it was stopped")
        until(lambda: len(samples) > went_on + 200, "samples")
        assert STOPPED_S - 0.5 < links[-1].stopped_s < STOPPED_S + 30.0
        assert "this gateway's process was stopped" in links[-1].message
        stalls = [f.text for m in boards for f in m.faults if f.name == "uart-stall"]
        # That the gateway was stopped is not the line's silence; the board's own process, on a busy
        # machine, may have a moment of it.
        silences = [float(s) for text in stalls for s in re.findall(r"silent for ([\d.]+)", text)]
        assert max(silences, default=0.0) < STOPPED_S / 2, stalls
        session.close()
        del keep
    # every stamp lies before the moment it was heard, and none is later than it can be by its sigma
    early = [at - header.utc_ns * 1e-9 + 3.0 * header.utc_sigma_s for at, header in samples]
    assert min(early) > -0.05
    (path,) = tmp_path.rglob("session.json")
    manifest = json.loads(path.read_text())
    steps = [round(step["step_s"] / YEAR_S, 3) for step in manifest["clock_steps"]]
    assert steps == [-1.0, 1.0]
    assert manifest["end_utc_ns"] - manifest["start_utc_ns"] < 600e9
    (table,) = tables(path.parent / manifest["file"], Selection(frozenset({ACCEL.name}))).values()
    utc_s = table.data["utc_s"]
    assert np.ptp(utc_s) < 600.0 and (np.diff(utc_s) > -0.5).all()
    assert len(np.unique(utc_s)) > 0.99 * len(utc_s)
