"""Connections that hang, drip or take nothing, many of them, and people who want to get in."""

import asyncio
import contextlib
import os
import resource
import socket
import time

import httpx
import pytest
from support.front_door import message, open_door
from support.waiting import until

from dashboard.service import NoFiles
from dashboard.web import connections
from dashboard.web.connections import trusted

HEAD = b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\n"


@contextlib.contextmanager
def sockets(door, number: int, address: str, first: bytes = b""):
    """So many connections from that address, each with these first bytes."""
    links = []
    try:
        for _ in range(number):
            link = socket.create_connection(
                ("127.0.0.1", door.settings.port), source_address=(address, 0), timeout=10.0
            )
            link.sendall(first)
            links.append(link)
        yield links
    finally:
        for link in links:
            link.close()


def ended(link: socket.socket) -> bool:
    link.settimeout(0.0)
    try:
        return link.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def still_open(links: list[socket.socket]) -> int:
    return sum(not ended(link) for link in links)


@pytest.fixture(scope="module")
def patient(tmp_path_factory):
    """A door whose idle connections may stay for minutes: only the limits help."""
    with open_door(
        tmp_path_factory.mktemp("patient"),
        request_s=300.0,
        connections=120,
        connections_per_address=40,
    ) as door:
        yield door


@pytest.mark.parametrize("first", [b"", HEAD], ids=["silent", "half a head"])
def test_people_get_in_while_700_connections_of_one_address_hang(patient, first):
    with patient.client("otto") as before, sockets(patient, 350, "127.0.0.2", first) as flood:
        assert before.get("/api/me").status_code == 200  # who was in stays in
        with sockets(patient, 350, "127.0.0.2", first) as more:
            until(lambda: still_open(flood + more) <= 40, "at most 40 of one address")
            with patient.client("anna") as fresh:  # signs in, from another address
                assert fresh.get("/").status_code == 200
                with patient.scene(fresh) as scene:
                    assert scene.recv(timeout=20.0)
            transport = httpx.HTTPTransport(local_address="127.0.0.2")
            with httpx.Client(base_url=patient.url, transport=transport) as beside:
                for _ in range(5):  # and from the very address of the flood
                    assert beside.get("/login").status_code == 200
        assert before.get("/api/me").status_code == 200


def test_many_addresses_together_do_not_lock_anybody_out(patient):
    with contextlib.ExitStack() as stack:
        flood = []
        for k in range(2, 9):
            flood += stack.enter_context(sockets(patient, 35, f"127.0.0.{k}", HEAD))
        until(lambda: still_open(flood) <= 120, "at most 120 in all")
        with patient.client("anna") as fresh:
            for _ in range(5):
                assert fresh.get("/sessions").status_code == 200


def test_what_asks_nothing_is_ended_and_what_works_is_not(tmp_path):
    with open_door(tmp_path, request_s=4.0, body_timeout_s=2.0) as door:
        with (
            door.client("otto") as client,
            sockets(door, 3, "127.0.0.2") as silent,
            sockets(door, 3, "127.0.0.2", HEAD) as half,
            sockets(door, 3, "127.0.0.2", HEAD + b"\r\n") as answered,
            sockets(
                door,
                3,
                "127.0.0.2",
                b"POST /login HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n",
            ) as bodies,
            door.scene(client) as scene,
        ):
            for link in answered:
                assert b"200 OK" in link.recv(65536)

            def dripped() -> bool:
                for link in half:
                    with contextlib.suppress(OSError):
                        link.settimeout(1.0)
                        link.sendall(b"X-A: b\r\n")
                for link in bodies:
                    with contextlib.suppress(OSError):
                        link.settimeout(1.0)
                        link.sendall(b"1\r\na\r\n")
                    with contextlib.suppress(OSError):
                        link.settimeout(0.0)
                        link.recv(65536)  # 408
                with contextlib.suppress(OSError, AssertionError):
                    for link in answered:
                        link.settimeout(0.0)
                        link.recv(65536)
                return not still_open(silent + half + answered + bodies)

            until(dripped, "the end of all that hang")
            # a scene that only looks on is no idle connection
            scene.send(message("ViewerCameraMessage"))
            assert scene.recv(timeout=20.0)


def test_who_takes_nothing_of_an_answer_is_ended_and_who_takes_little_is_not(tmp_path, monkeypatch):
    """Real sockets with small buffers, a file of a MB; memory that waits for them is the kernel's
    and little. Half a kB at a time is enough to stay.
    """
    monkeypatch.setattr(connections, "LEAST_TAKEN", 64)
    ask = b"GET /static/vendor/maplibre/maplibre-gl.mjs HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with open_door(tmp_path, take_s=3.0) as door, contextlib.ExitStack() as stack:
        links = []
        for _ in range(12):
            link = stack.enter_context(socket.socket())
            link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            link.settimeout(10.0)
            link.connect(("127.0.0.1", door.settings.port))
            link.sendall(ask)
            links.append(link)
        slow, silent = links[:2], links[2:]

        def ended() -> bool:
            for link in slow:
                link.settimeout(0.0)
                with contextlib.suppress(BlockingIOError):
                    assert link.recv(2048), "it was ended, and took what it could"
            return door.front.ended["took nothing"] == len(silent)

        until(ended, "the end of all that take nothing")
        for link in silent:
            with pytest.raises(ConnectionResetError):
                while link.recv(65536):
                    pass
        end = time.monotonic() + 2 * door.settings.take_s
        while time.monotonic() < end:
            time.sleep(0.02)
            assert ended()


def test_a_connection_that_goes_on_asking_is_not_idle(tmp_path):
    """However short its requests are, between which everybody looks at it."""
    ask = HEAD + b"\r\n"
    with open_door(tmp_path, request_s=4.0) as door, sockets(door, 1, "127.0.0.2") as (link,):
        link.settimeout(5.0)
        for _ in range(40):
            link.sendall(ask)
            answer = b""
            while b"</html>" not in answer:
                part = link.recv(65536)
                assert part, "it was ended"
                answer += part
            time.sleep(0.12)


def test_a_head_without_an_end_is_refused(patient):
    with sockets(patient, 1, "127.0.0.3", HEAD) as (link,):
        with contextlib.suppress(OSError):
            for _ in range(100):
                link.sendall(b"X-Long: " + b"a" * 4000 + b"\r\n")
        until(lambda: b"" == _rest(link), "the end of it")


def _rest(link: socket.socket) -> bytes:
    link.settimeout(5.0)
    try:
        while link.recv(65536):
            pass
    except OSError:
        pass
    return b""


def test_proxies_of_ours_are_known_by_address_and_network():
    ours = ["10.1.0.0/16", "::1", "192.168.1.5", "proxy"]
    for address in ("10.1.2.3", "::1", "192.168.1.5", "proxy"):
        assert trusted(address, ours) and trusted(address, ["*"])
    for address in ("10.2.0.1", "::2", "192.168.1.6", "unknown", ""):
        assert not trusted(address, ours) and not trusted(address, [])


def test_scenes_of_one_user_and_of_all_are_counted(tmp_path):
    with open_door(tmp_path, scenes_per_user=3, scenes=4) as door:
        with door.client("otto") as otto, door.client("vera") as vera, contextlib.ExitStack() as up:
            for _ in range(3):
                up.enter_context(door.scene(otto))
            with pytest.raises(Exception, match="403"):
                door.scene(otto)
            scene = up.enter_context(door.scene(vera))
            with pytest.raises(Exception, match="403"):
                door.scene(vera)
            scene.close()
            until(lambda: _opens(door, vera), "room again")


def _opens(door, client) -> bool:
    try:
        door.scene(client).close()
    except Exception:
        time.sleep(0.1)
        return False
    return True


@contextlib.contextmanager
def without_files():
    """No file can be opened in this process meanwhile."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    lowest = os.dup(0)
    os.close(lowest)
    resource.setrlimit(resource.RLIMIT_NOFILE, (lowest, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.mark.parametrize("ends", ["afterwards", "meanwhile"])
def test_a_page_without_files_says_so_once_and_takes_who_waited_afterwards(ends, caplog):
    async def crowd() -> bytes:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(NoFiles())
        server = await asyncio.start_server(lambda _, out: out.close(), "127.0.0.1", 0)
        with socket.socket() as caller:
            caller.setblocking(False)
            with without_files():
                await loop.sock_connect(caller, server.sockets[0].getsockname())
                while not caplog.records:
                    await asyncio.sleep(0.01)
                if ends == "meanwhile":
                    server.close()
                    await asyncio.sleep(1.2)  # asyncio tries again after 1 s
                    return b""
            told = await loop.sock_recv(caller, 1)  # the end, from who took it at last
            server.close()
            return told

    assert asyncio.run(crowd()) == b""
    assert [record.exc_info for record in caplog.records] == [None]
    assert "no file is left" in caplog.text
