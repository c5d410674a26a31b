"""The ways out: a server of somebody's by POST, and mail."""

import hashlib
import hmac
import json
import smtplib
import ssl
from dataclasses import asdict
from datetime import UTC, datetime
from email.message import EmailMessage
from email.utils import make_msgid
from pathlib import Path

import httpx

from dashboard.alarms.notices import DeliveryError, Notice
from dashboard.alarms.settings import AlarmSettings, MailSettings, WebhookSettings
from messages.text import plain

SIGNATURE, MOMENT = "X-Gyrofree-Signature", "X-Gyrofree-Time"


def ways_of(settings: AlarmSettings) -> "list[Webhook | Mail]":
    """Those of the configuration."""
    found: list[Webhook | Mail] = []
    if settings.webhook is not None:
        found.append(Webhook(settings.webhook))
    if settings.mail is not None:
        found.append(Mail(settings.mail))
    return found


def _first_line(path: Path, what: str) -> str:
    try:
        with path.open(encoding="utf-8") as stream:
            line = stream.readline().strip()
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise DeliveryError(f"{what} {path}: {why}") from None
    if not line:
        raise DeliveryError(f"{what} {path}: its first line is empty")
    return line


def signature(secret: str, moment: str, body: bytes) -> str:
    """Hex HMAC-SHA256 of `moment.body`: who has the secret knows that it is ours, and when from."""
    return hmac.new(secret.encode(), moment.encode() + b"." + body, hashlib.sha256).hexdigest()


class Webhook:
    """POST of JSON. Any answer but 2xx is a refusal, a redirect too: it could lead anywhere."""

    name = "webhook"

    def __init__(self, settings: WebhookSettings) -> None:
        self.level, self._settings = settings.level, settings

    def deliver(self, notice: Notice) -> None:
        """Raises DeliveryError."""
        settings = self._settings
        body = json.dumps(asdict(notice), ensure_ascii=False, sort_keys=True).encode()
        headers = {"content-type": "application/json", "user-agent": "gyrofree-alarms"}
        if settings.secret_file is not None:
            secret = _first_line(settings.secret_file, "secret_file")
            moment = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
            headers |= {MOMENT: moment, SIGNATURE: f"sha256={signature(secret, moment, body)}"}
        try:
            # stream: the answer's body is not read, however long it is
            with (
                httpx.Client(
                    timeout=settings.timeout_s, follow_redirects=False, trust_env=False
                ) as client,
                client.stream("POST", settings.url, content=body, headers=headers) as answer,
            ):
                status = answer.status_code
        except (httpx.HTTPError, httpx.InvalidURL, ValueError) as error:
            raise DeliveryError(plain(f"{type(error).__name__}: {error}", 300)) from None
        if not 200 <= status < 300:
            raise DeliveryError(f"the server answered {status}")


class Mail:
    """One mail for each notice."""

    name = "mail"

    def __init__(self, settings: MailSettings) -> None:
        self.level, self._settings = settings.level, settings

    def deliver(self, notice: Notice) -> None:
        """Raises DeliveryError."""
        settings = self._settings
        try:
            with self._server() as server:
                if settings.safety == "starttls":
                    server.starttls(context=ssl.create_default_context())
                if settings.user:
                    if settings.password_file is None:
                        raise DeliveryError("[alarms.mail] has a user and no password_file")
                    password = _first_line(settings.password_file, "password_file")
                    server.login(settings.user, password)
                server.send_message(message_of(notice, settings))
        except (smtplib.SMTPException, OSError, ValueError) as error:
            raise DeliveryError(plain(f"{type(error).__name__}: {error}", 300)) from None

    def _server(self) -> smtplib.SMTP:
        settings = self._settings
        where = settings.host, settings.port
        if settings.safety == "tls":
            context = ssl.create_default_context()
            return smtplib.SMTP_SSL(*where, timeout=settings.timeout_s, context=context)
        return smtplib.SMTP(*where, timeout=settings.timeout_s)


def message_of(notice: Notice, settings: MailSettings) -> EmailMessage:
    """The mail. Nothing in it that comes from outside can be a header."""
    message = EmailMessage()
    message["Subject"] = plain(f"gyrofree: {notice.line}", 150)
    message["From"], message["To"] = settings.sender, ", ".join(settings.to)
    message["Message-ID"] = make_msgid(domain=settings.sender.rpartition("@")[2])
    when = datetime.fromtimestamp(notice.utc_ns * 1e-9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    lines = [notice.line, "", plain(notice.text, 1000), "", f"since {when}"]
    if notice.more:
        lines.append(f"raised {notice.more} times more since the last notice")
    lines += ["it comes and goes (chattering)"] if notice.chattering else []
    lines += ["the first of those that are there together"] if notice.first_out else []
    message.set_content("\n".join(lines) + "\n")
    return message
