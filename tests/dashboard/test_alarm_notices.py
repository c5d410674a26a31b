"""Notices of alarms reach a real web server and a real mail server, later if need be, never twice
by a redirect and never without what keeps them safe.
"""

import json
import ssl
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from support.certificates import make_certificate
from support.mail_server import mail_server
from support.stack import free_port
from support.waiting import until

from dashboard.alarms import notices
from dashboard.alarms.notices import DeliveryError, Notice, Sender
from dashboard.alarms.own_place import told
from dashboard.alarms.settings import AlarmSettings, MailSettings, WebhookSettings
from dashboard.alarms.state_file import load
from dashboard.alarms.ways import MOMENT, SIGNATURE, Mail, Webhook, signature
from messages.bus.session import BusSettings, open_client, open_router

NOTICE = Notice(
    "axis-a21",
    "cube",
    "critical",
    "axis a21 stuck\r\nBcc: everybody@example.org",
    "reads the same \u202e again",
    1_700_000_000 * 10**9,
)


@pytest.fixture
def hook():
    """A web server that keeps what it gets and answers `status`."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["content-length"]))
            server.got.append((self.path, dict(self.headers), body))
            self.send_response(server.status)
            self.send_header("location", "/elsewhere")
            self.end_headers()

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.got, server.status = [], 204
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


def webhook(server, **more):
    return Webhook(WebhookSettings(url=f"http://127.0.0.1:{server.server_port}/in", **more))


def test_a_webhook_gets_json_that_is_signed(hook, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("between us\nnot this\n")
    webhook(hook, secret_file=secret).deliver(NOTICE)
    ((path, headers, body),) = hook.got
    said = json.loads(body)
    assert path == "/in" and said["id"] == "axis-a21" and said["level"] == "critical"
    named = {name.lower(): value for name, value in headers.items()}
    wanted = signature("between us", named[MOMENT.lower()], body)
    assert named[SIGNATURE.lower()] == f"sha256={wanted}"


def test_a_redirect_is_not_followed_and_is_a_refusal(hook):
    hook.status = 307
    with pytest.raises(DeliveryError, match="307"):
        webhook(hook).deliver(NOTICE)
    assert [path for path, _, _ in hook.got] == ["/in"]


@pytest.mark.parametrize(
    "url", ["file:///etc/passwd", "ftp://host/", "http://", "host", "http://a:0"]
)
def test_only_web_addresses_are_told(url):
    with pytest.raises(ValueError, match="want http"):
        WebhookSettings(url=url)


def test_a_notice_waits_for_its_server_over_a_restart(hook, tmp_path, monkeypatch):
    monkeypatch.setattr(notices, "PAUSE_FIRST", 0.02)
    path, way = tmp_path / "hook.json", webhook(hook)
    hook.status = 503
    sender = Sender(way, path)
    sender.offer(NOTICE)
    until(lambda: len(hook.got) >= 2, "a second attempt")
    assert sender.waiting == 1 and "503" in sender.fault
    sender.close()
    hook.status, before = 200, len(hook.got)
    again = Sender(way, path)
    until(lambda: again.sent == 1 and again.waiting == 0, "it was delivered")
    assert len(hook.got) == before + 1 and not again.fault
    again.close()
    last = Sender(way, path)
    assert last.waiting == 0  # nothing is told twice
    last.close()


def test_less_than_the_level_is_not_told_and_a_flood_is_counted(hook, tmp_path, monkeypatch):
    monkeypatch.setattr(notices, "WAITING", 5)
    monkeypatch.setattr(notices, "PAUSE_FIRST", 60.0)
    hook.status = 500
    sender = Sender(webhook(hook, level="critical"), tmp_path / "hook.json")
    sender.offer(notices.Notice("x", "", "warning", "t", "", 1))
    assert sender.waiting == 0
    for _ in range(9):
        sender.offer(NOTICE)
    assert sender.waiting == 5 and sender.given_up == 4
    sender.close()


def test_an_office_tells_its_own_people_once_over_a_restart(hook, tmp_path):
    """No service of alarms runs there: its site service tells."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    bus = BusSettings(prefix="t", router=endpoint, listen=[endpoint]).acting_as("authority")
    settings = AlarmSettings(
        state=tmp_path / "alarms.json",
        disk_free_bytes=1 << 60,
        webhook=WebhookSettings(url=f"http://127.0.0.1:{hook.server_port}/in"),
    )
    with open_router(bus), open_client(bus) as session:
        with told(session, bus, "office", settings, tmp_path):
            until(lambda: hook.got, "the notice")
        said = json.loads(hook.got[0][2])
        assert (said["id"], said["level"], said["site"]) == ("disk", "critical", "t")
        again = settings.model_copy(update={"disk_free_bytes": 1 << 61})
        with told(session, bus, "office", again, tmp_path):
            book = load(settings.state)[0]
            assert book.points["", "disk"].active
            time.sleep(1.0)
    assert len(hook.got) == 1


def settings_of(server, **more):
    safe = {"safety": "none"} | more
    return MailSettings(
        host="127.0.0.1",
        port=server.port,
        sender="lab@example.org",
        to=["anna@example.org"],
        **safe,
    )


def test_a_mail_says_what_is_wrong_and_no_text_becomes_a_header():
    with mail_server() as server:
        Mail(settings_of(server)).deliver(NOTICE)
        (mail,) = server.mails
        assert mail["To"] == "anna@example.org" and mail["Bcc"] is None
        assert "CRITICAL cube: axis a21 stuck" in mail["Subject"]
        assert "\u202e" not in mail.get_content() and "reads the same" in mail.get_content()
        assert server.to == ["<anna@example.org>"]
        server.refuses = True
        with pytest.raises(DeliveryError):
            Mail(settings_of(server)).deliver(NOTICE)


def test_mail_is_never_sent_unprotected_where_it_is_to_be_protected():
    with mail_server() as server:
        with pytest.raises(DeliveryError, match="STARTTLS"):
            Mail(settings_of(server, safety="starttls")).deliver(NOTICE)
        assert not server.mails


@pytest.fixture
def protected(tmp_path, monkeypatch):
    """A mail server that offers STARTTLS and wants a sign-in, whose certificate is trusted."""
    certificate, key = make_certificate(tmp_path)
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certificate, key)
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    with mail_server(tls=context, login=("lab", "between us")) as server:
        yield server


def signed_in(tmp_path, server, password="between us", **more):
    file = tmp_path / "password"
    file.write_text(f"{password}\n")
    safe = {"safety": "starttls", "user": "lab", "password_file": file} | more
    settings = settings_of(server, **safe)
    return Mail(settings.model_copy(update={"host": "localhost"}))


def said_in_clear(server) -> set[str]:
    return {line.split(" ")[0].upper() for line in server.clear}


def test_a_mail_goes_encrypted_with_its_sign_in_after_the_handshake(protected, tmp_path):
    signed_in(tmp_path, protected).deliver(NOTICE)
    (mail,) = protected.mails
    assert "axis a21 stuck" in mail["Subject"]
    assert said_in_clear(protected) == {"EHLO", "STARTTLS"}
    assert {"AUTH", "MAIL", "RCPT", "DATA"} <= {
        one.split(" ")[0].upper() for one in protected.hidden
    }


def test_a_certificate_that_is_not_trusted_ends_it_and_nothing_is_said(
    protected, tmp_path, monkeypatch
):
    monkeypatch.delenv("SSL_CERT_FILE")
    with pytest.raises(DeliveryError, match="(?i)certificate"):
        signed_in(tmp_path, protected).deliver(NOTICE)
    assert not protected.mails and said_in_clear(protected) == {"EHLO", "STARTTLS"}


def test_a_certificate_of_another_host_ends_it_and_nothing_is_said(protected, tmp_path):
    login = ("lab", "between us")
    with mail_server(tls=protected.tls, login=login, host="127.0.0.9") as server:
        way = signed_in(tmp_path, server)
        another = Mail(way._settings.model_copy(update={"host": server.host}))
        with pytest.raises(DeliveryError, match="127.0.0.9"):
            another.deliver(NOTICE)
        assert not server.mails and said_in_clear(server) == {"EHLO", "STARTTLS"}


def test_a_sign_in_that_is_refused_is_said_and_no_mail_is_given(protected, tmp_path):
    with pytest.raises(DeliveryError, match="wrong name or password"):
        signed_in(tmp_path, protected, "something else").deliver(NOTICE)
    assert not protected.mails and said_in_clear(protected) == {"EHLO", "STARTTLS"}
    assert not [line for line in protected.hidden if line.upper().startswith("MAIL")]


def test_where_starttls_is_not_offered_neither_password_nor_mail_is_said(tmp_path):
    with mail_server(login=("lab", "between us")) as server:
        with pytest.raises(DeliveryError, match="STARTTLS"):
            signed_in(tmp_path, server).deliver(NOTICE)
        assert not server.mails and said_in_clear(server) <= {"EHLO", "STARTTLS", "QUIT"}


@pytest.mark.parametrize("to", ["nobody", "a@b.org\r\nBcc: c@d.org", "A <a@b.org>", "a@b.org,c@d"])
def test_only_bare_addresses_are_taken(to):
    with pytest.raises(ValueError):
        MailSettings(host="h", sender="lab@example.org", to=[to])


def test_no_secret_is_part_of_the_settings_that_are_kept_with_a_session(tmp_path):
    settings = AlarmSettings(
        webhook=WebhookSettings(url="https://example.org/", secret_file=tmp_path / "secret")
    )
    kept = settings.model_dump(mode="json")["webhook"]
    assert kept["secret_file"] == str(tmp_path / "secret") and "secret" not in kept
