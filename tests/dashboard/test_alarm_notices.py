"""Notices of alarms reach a real web server and a real mail server, later if need be, never twice
by a redirect and never without what keeps them safe.
"""

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from support.mail_server import mail_server
from support.waiting import until

from dashboard.alarms import notices
from dashboard.alarms.notices import DeliveryError, Notice, Sender
from dashboard.alarms.settings import AlarmSettings, MailSettings, WebhookSettings
from dashboard.alarms.ways import MOMENT, SIGNATURE, Mail, Webhook, signature

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
