"""Connections to other machines are given up in time, and nothing else is touched."""

import contextlib
import os
import socket
import subprocess
import sys

from messages.bus.timeouts import GIVEN_UP_MS, NOTSENT_LOWAT, UNSENT, look


def given_up_ms(one: socket.socket) -> int:
    return one.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)


def test_sockets_of_this_machine_and_what_is_no_tcp_stay_as_they_are():
    with contextlib.ExitStack() as stack:
        far = stack.enter_context(socket.socket())  # not bound yet, as one that still connects
        six = stack.enter_context(socket.socket(socket.AF_INET6))
        here = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        client = stack.enter_context(socket.create_connection(here.getsockname()))
        mapped = stack.enter_context(socket.socket(socket.AF_INET6))
        mapped.bind(("::ffff:127.0.0.1", 0))
        for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM):
            stack.enter_context(socket.socket(socket.AF_UNIX, kind))
        stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        files = len(os.listdir("/proc/self/fd"))
        for _ in range(3):
            look()
        assert [given_up_ms(one) for one in (far, six)] == [GIVEN_UP_MS, GIVEN_UP_MS]
        assert [given_up_ms(one) for one in (here, client, mapped)] == [0, 0, 0]
        unsent = [one.getsockopt(socket.IPPROTO_TCP, NOTSENT_LOWAT) for one in (far, six, client)]
        assert unsent == [UNSENT, UNSENT, 0]
        assert len(os.listdir("/proc/self/fd")) == files


CHILD = """
import socket
far = socket.socket()
print("ready", flush=True)
input()
print(far.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT))
"""


def test_sockets_of_a_child_too_until_it_has_ended():
    words = [sys.executable, "-P", "-c", CHILD]
    with subprocess.Popen(words, stdin=-1, stdout=-1, text=True) as child:
        assert child.stdout.readline() == "ready\n"
        files = len(os.listdir("/proc/self/fd"))
        look(child.pid)
        assert len(os.listdir("/proc/self/fd")) == files
        assert child.communicate("go on\n")[0] == f"{GIVEN_UP_MS}\n"
    look(child.pid)  # it is gone
