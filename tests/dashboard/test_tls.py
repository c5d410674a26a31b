"""TLS on the web port by itself: what is spoken, what is taken anew, and floods before a word."""

import contextlib
import shutil
import socket
import ssl

import pytest
from cryptography.hazmat.primitives import serialization
from support.certificates import make_certificate
from support.front_door import PASSWORDS, Door, message, open_door
from support.waiting import until

from dashboard.settings import DashboardSettings
from dashboard.web.tls.certificate import CertificateError, open_certificate
from gyrofree.config import Settings
from gyrofree.running.doctor import examine, health

ASK = b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\n"
HELLO = bytes.fromhex("1603010200010001fc0303")  # a record of 512 bytes that never come


def tls_door(folder, **options):
    certificate, key = make_certificate(folder)
    return open_door(folder, tls_certificate=certificate, tls_key=key, **options)


@contextlib.contextmanager
def linked(door: Door, number: int, first: bytes = b"", room: int = 0):
    """So many TCP connections of an address of their own that say this first, and take no more
    than about `room` bytes that nobody reads.
    """
    with contextlib.ExitStack() as stack:
        links = []
        for _ in range(number):
            link = stack.enter_context(socket.socket())
            if room:
                link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
            link.settimeout(10.0)
            link.bind(("127.0.0.2", 0))
            link.connect(("127.0.0.1", door.settings.port))
            link.sendall(first)
            links.append(link)
        yield links


def ended(link: socket.socket) -> bool:
    link.settimeout(0.0)
    try:
        return link.recv(4096) == b""
    except (BlockingIOError, ssl.SSLWantReadError):
        return False
    except OSError:
        return True


def peer(door: Door) -> bytes:
    """The certificate that a new connection is shown."""
    anybody = ssl.create_default_context()
    anybody.check_hostname, anybody.verify_mode = False, ssl.CERT_NONE
    with linked(door, 1) as (link,), anybody.wrap_socket(link) as tls:
        return tls.getpeercert(binary_form=True)


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    with tls_door(
        tmp_path_factory.mktemp("tls"),
        request_s=300.0,
        connections=120,
        connections_per_address=40,
    ) as opened:
        yield opened


def test_a_person_signs_in_and_sees_the_scene_over_tls(door: Door):
    with door.client() as client:
        answer = client.post("/login", data={"name": "otto", "password": PASSWORDS["otto"]})
        cookie = answer.headers["set-cookie"]
        assert cookie.startswith("__Host-gyrofree=") and "Secure" in cookie
        assert answer.headers["strict-transport-security"] == "max-age=31536000"
        policy = client.get("/scene/").headers["content-security-policy"]
        assert "wss://127.0.0.1" in policy and "ws://" not in policy.replace("wss://", "")
        with door.scene(client) as scene:
            scene.send(message("ViewerCameraMessage"))
            assert scene.recv(timeout=60.0)
        local = client.get("/api/health", headers={"host": "localhost"})
        assert local.status_code == 200 and "strict-transport-security" not in local.headers
    settings = Settings(dashboard=door.settings)
    assert health("dashboard", settings).state == "ok"
    [found] = [one for one in examine(settings) if one.check == "certificate of the page"]
    assert found.state == "ok" and "localhost" in found.found


@pytest.mark.parametrize(
    ("newest", "ciphers", "served"),
    [
        (ssl.TLSVersion.TLSv1_1, "ALL:@SECLEVEL=0", False),
        (ssl.TLSVersion.TLSv1_2, "ECDHE-ECDSA-AES128-SHA256:@SECLEVEL=0", False),
        (ssl.TLSVersion.TLSv1_2, "ECDHE-ECDSA-AES128-GCM-SHA256", True),
        (ssl.TLSVersion.TLSv1_3, "DEFAULT", True),
    ],
)
@pytest.mark.filterwarnings("ignore:ssl.TLSVersion.TLSv1_1")
def test_old_versions_and_weak_suites_are_refused(door: Door, newest, ciphers, served):
    context = ssl.create_default_context(cafile=door.settings.tls_certificate)
    context.set_ciphers(ciphers)
    context.minimum_version = min(newest, ssl.TLSVersion.TLSv1_2)
    context.maximum_version = newest
    refusal = contextlib.nullcontext() if served else pytest.raises(ssl.SSLError)
    with linked(door, 1) as (link,), refusal:
        with context.wrap_socket(link, server_hostname="127.0.0.1") as tls:
            assert tls.selected_alpn_protocol() is None and tls.cipher()


@pytest.mark.parametrize("first", [ASK + b"\r\n", b"\x80\x2e\x01", b"\x00" * 4000])
def test_http_on_the_port_of_tls_is_told_so(door: Door, first):
    before = door.front.ended["http where TLS is spoken"]
    with linked(door, 1, first) as (link,):
        answer = b""
        with contextlib.suppress(ConnectionResetError):
            while part := link.recv(4096):
                answer += part
    assert answer.startswith(b"HTTP/1.1 400 ") and b"https://" in answer
    until(lambda: door.front.ended["http where TLS is spoken"] > before, "it is counted")


@pytest.mark.parametrize("first", [b"", HELLO], ids=["silent", "half a handshake"])
def test_people_get_in_while_connections_hang_before_their_handshake(door: Door, first):
    with door.client("otto") as before, linked(door, 300, first) as flood:
        assert before.get("/api/me").status_code == 200
        until(lambda: sum(not ended(one) for one in flood) <= 40, "at most 40 of one address")
        with door.client("anna") as fresh, door.scene(fresh) as scene:
            assert scene.recv(timeout=60.0)
        assert before.get("/api/me").status_code == 200


def test_what_hangs_in_or_after_its_handshake_or_takes_nothing_is_ended(tmp_path):
    with (
        tls_door(tmp_path, request_s=4.0, take_s=3.0) as door,
        door.client("otto") as client,
        door.scene(client) as scene,
        linked(door, 2) as silent,
        linked(door, 2, HELLO) as half,
        linked(door, 2) as shaken,
        linked(door, 2) as asking,
        linked(door, 2, room=4096) as deaf,
    ):
        hold = [door.trust.wrap_socket(one, server_hostname="127.0.0.1") for one in shaken]
        asked = [door.trust.wrap_socket(one, server_hostname="127.0.0.1") for one in asking]
        for one in asked:
            one.sendall(ASK)
        takes_nothing = []
        for one in deaf:
            tls = door.trust.wrap_socket(one, server_hostname="127.0.0.1")
            tls.sendall(ASK.replace(b"/login", b"/static/vendor/maplibre/maplibre-gl.mjs"))
            tls.sendall(b"Connection: close\r\n\r\n")
            takes_nothing.append(tls)
        until(lambda: all(map(ended, [*silent, *half, *hold, *asked])), "the end of all that hang")
        until(lambda: door.front.ended["took nothing"] == 2, "the end of who takes nothing")
        assert sum(door.front.ended[why] for why in ("asked nothing", "no TLS handshake")) >= 8
        scene.send(message("ViewerCameraMessage"))
        assert scene.recv(timeout=60.0)
        for one in (*hold, *asked, *takes_nothing):
            one.close()


def test_a_new_certificate_is_taken_and_ends_nothing(tmp_path):
    with tls_door(tmp_path) as door, door.client("otto") as client, door.scene(client) as scene:
        served, first = door.front.certificate, peer(door)
        others = make_certificate(tmp_path / "others")
        shutil.copy(others[1], door.settings.tls_key)  # for a moment they do not fit together
        until(lambda: served.fault, "the fault is seen")
        assert "not the key" in served.fault and peer(door) == first
        shutil.copy(others[0], door.settings.tls_certificate)
        until(lambda: served.renewed == 1, "the new pair is taken")
        assert peer(door) != first and served.fault == ""
        scene.send(message("ViewerCameraMessage"))
        assert scene.recv(timeout=60.0)
        assert client.get("/api/me").status_code == 200  # on the connection from before


@pytest.mark.parametrize(
    ("days", "old_days", "text"),
    [(-1.0, 30.0, "ended on"), (20.0, 300.0, "in 20.0 days"), (1.0, 5.0, "in 1.0 days")],
)
def test_the_end_of_a_certificate_is_said(tmp_path, caplog, days, old_days, text):
    certificate, key = make_certificate(tmp_path, days, old_days)
    settings = DashboardSettings(tls_certificate=certificate, tls_key=key)
    assert open_certificate(settings).near_its_end and text in caplog.text
    [found] = [
        one
        for one in examine(Settings(dashboard=settings))
        if one.check == "certificate of the page"
    ]
    assert found.state == ("fail" if days < 0 else "warn")


def test_a_certificate_of_a_few_days_is_not_near_its_end_all_the_time(tmp_path, caplog):
    certificate, key = make_certificate(tmp_path, 6.0, 1.0)
    made = open_certificate(DashboardSettings(tls_certificate=certificate, tls_key=key))
    assert not made.near_its_end and "127.0.0.1" in made.names and caplog.text == ""


def test_files_that_cannot_be_served_are_refused_with_the_reason(tmp_path):
    certificate, key = make_certificate(tmp_path)
    other = make_certificate(tmp_path / "other")[1]
    locked, rubbish = tmp_path / "locked.key", tmp_path / "rubbish"
    rubbish.write_bytes(b"\x00-----BEGIN CERTIFICATE-----")
    locked.write_bytes(
        serialization.load_pem_private_key(key.read_bytes(), None).private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.BestAvailableEncryption(b"a word"),
        )
    )
    for pair, text in (
        ((certificate, other), "not the key"),
        ((certificate, locked), "locked by a password"),
        ((certificate, rubbish), "no private key"),
        ((rubbish, key), "no certificate"),
        ((tmp_path / "absent", key), "No such file"),
        ((certificate, tmp_path), "directory"),
    ):
        with pytest.raises(CertificateError, match=text):
            open_certificate(DashboardSettings(tls_certificate=pair[0], tls_key=pair[1]))
    with pytest.raises(ValueError, match="both"):
        DashboardSettings(tls_key=key)
