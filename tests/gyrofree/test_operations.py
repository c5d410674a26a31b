"""Logs for programs, how much is logged while a service runs, and its figures: real processes."""

import io
import json
import logging
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console
from support.stack import free_port

from gyrofree.operations.log_form import JsonLine
from gyrofree.operations.log_level import LogLevel
from gyrofree.operations.settings import SERVICES
from gyrofree.running.supervisor import Supervisor
from sites.roles import SERVICES as ROLES

VALUES = st.one_of(st.text(), st.integers(), st.floats(), st.binary(), st.none(), st.booleans())


@settings(max_examples=60, deadline=None)
@given(st.text(), st.dictionaries(st.from_regex(r"[a-z]{3,8}_x", fullmatch=True), VALUES), VALUES)
def test_a_record_is_one_line_of_json_whatever_is_in_it(text, fields, wrong):
    try:
        raise ValueError(wrong)
    except ValueError:
        fault = sys.exc_info()
    record = logging.LogRecord("room", logging.WARNING, "x.py", 1, text, (), fault)
    vars(record).update(fields)
    line = JsonLine("gateway").format(record)
    assert len(line.splitlines()) == 1 and line.isascii() and line.isprintable()

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    read = json.loads(line, parse_constant=refuse)
    assert read["service"] == "gateway" and read["level"] == "warning"
    assert read["time"].endswith("Z") and "ValueError" in read["traceback"]
    assert set(read.get("fields", {})) == set(fields)


def test_a_level_holds_for_its_time_and_the_last_order_counts():
    logger = logging.Logger("own", logging.INFO)
    level = LogLevel(logger)
    level.set("debug", 60.0, "ann")
    assert level.name == "debug"
    level.set("debug", 0.05, "ann")
    end = time.monotonic() + 20.0
    while level.name != "info":
        assert time.monotonic() < end
        time.sleep(0.01)
    level.set("debug", 0.05, "ann")
    level.set("error", 0.0, "bob")  # without an end
    time.sleep(0.2)
    assert level.name == "error"
    level.toggle()
    assert level.name == "debug"
    level.toggle()
    assert level.name == "info"
    with pytest.raises(ValueError, match="want one of debug, info"):
        level.set("loud", 1.0, "ann")
    level.close()


def test_every_service_that_a_site_has_is_one_here():
    assert set(SERVICES) == set(ROLES) - {"operator"}


def test_a_supervisor_says_everything_as_json():
    class Scripts(Supervisor):
        def _command(self, child):
            return [sys.executable, "-c", child.arguments[0]]

    out = Console(file=io.StringIO(), width=200)
    supervisor = Scripts(out, as_json=True)
    supervisor.add("web", "print('{\"service\": \"web\"}'); print('Segment\\x1b[2J')", once=True)
    supervisor.start()
    end = time.monotonic() + 20.0
    while not supervisor.done and time.monotonic() < end:
        supervisor.step()
        time.sleep(0.02)
    supervisor.say("a word", "yellow")
    supervisor.stop()
    lines = [json.loads(line) for line in out.file.getvalue().splitlines()]
    assert lines[0] == {"service": "web"}
    assert lines[1]["service"] == "web" and lines[1]["message"].startswith("Segment<U+001B>")
    assert lines[2]["level"] == "warning" and lines[2]["message"] == "a word"


@pytest.fixture
def router(tmp_path):
    bus, figures = free_port(), free_port()
    config = tmp_path / "gyrofree.toml"
    config.write_text(
        f'[bus]\nrouter = "tcp/127.0.0.1:{bus}"\nlisten = ["tcp/127.0.0.1:{bus}"]\n'
        f'[log]\nformat = "json"\n[metrics]\nport = {figures}\n'
    )
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "gyrofree", "router", "--config", str(config)],
        stderr=subprocess.PIPE,
        text=True,
    )
    lines = []
    for line in process.stderr:
        lines.append(json.loads(line))
        if "router listens" in lines[-1]["message"]:
            break
    yield process, config, figures, lines
    process.terminate()
    process.wait(20)


def next_line(process, word):
    for line in process.stderr:
        if word in (read := json.loads(line))["message"]:
            return read
    raise AssertionError(f"ended without {word!r}")


def test_a_running_service_is_asked_for_more_and_gives_its_figures(router):
    process, config, figures, lines = router
    assert {line["service"] for line in lines} == {"router"}

    def ask(*words):
        command = [sys.executable, "-P", "-m", "gyrofree", "log-level", *words]
        done = subprocess.run([*command, "--config", str(config)], capture_output=True, text=True)
        return done

    done = ask("router", "debug", "--minutes", "5", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    host = f"{socket.gethostname()} {process.pid}"
    assert answer == [{"ok": True, "text": f"{host}: log level debug for 300 s"}]
    assert next_line(process, "log level debug")["level"] == "warning"
    nobody = ask("gateway", "debug")
    assert nobody.returncode == 1 and "the gateway does not answer" in nobody.stderr
    assert ask("router", "loud").returncode == 2 and ask("kettle", "info").returncode == 2
    os.kill(process.pid, signal.SIGUSR1)  # it is detailed: as configured again
    assert "info" in next_line(process, "log level")["message"]
    with urllib.request.urlopen(f"http://127.0.0.1:{figures}/metrics", timeout=10) as answer:
        text = answer.read().decode()
    assert "process_resident_memory_bytes" in text
    [warned] = re.findall(r'gyrofree_log_messages_total\{level="warning"\} ([\d.]+)', text)
    assert float(warned) >= 2.0, text  # both changes of the level, and what else it says
