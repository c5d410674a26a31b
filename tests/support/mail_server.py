"""A real mail server for the tests: SMTP on a port of the loopback, one mail after the other."""

import asyncio
import base64
import contextlib
import ssl
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from email import message_from_bytes, policy
from email.message import EmailMessage


@dataclass
class MailServer:
    """Takes what it is given, as long as `refuses` is false."""

    port: int = 0
    mails: list[EmailMessage] = field(default_factory=list)
    to: list[str] = field(default_factory=list)
    refuses: bool = False
    host: str = "127.0.0.1"
    tls: ssl.SSLContext | None = None  # with one it offers STARTTLS
    login: tuple[str, str] = ("", "")  # that it takes once it is encrypted
    clear: list[str] = field(default_factory=list)  # lines that anybody could have read
    hidden: list[str] = field(default_factory=list)  # lines that nobody could

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One client, RFC 5321, 3207 and 4954 as far as a client of smtplib needs it."""
        encrypted, asked = False, self.login == ("", "")

        def say(line: str) -> None:
            writer.write(f"{line}\r\n".encode())

        say("220 test")
        with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError, ssl.SSLError):
            while line := (await reader.readline()).decode("ascii", "replace").strip():
                word = line.split(" ")[0].upper()
                (self.hidden if encrypted else self.clear).append(line)
                if word == "EHLO":
                    say("250-test")
                    if self.tls is not None and not encrypted:
                        say("250-STARTTLS")
                    if encrypted and self.login != ("", ""):
                        say("250-AUTH PLAIN")
                    say("250 8BITMIME")
                elif word == "STARTTLS" and self.tls is not None:
                    say("220 go on")
                    await writer.drain()
                    await writer.start_tls(self.tls)
                    encrypted = True
                elif word == "AUTH" and encrypted:
                    said = base64.b64decode(line.split(" ")[2]).decode().split("\0")
                    asked = tuple(said[1:]) == self.login
                    say("235 welcome" if asked else "535 wrong name or password")
                elif not asked and word in ("MAIL", "RCPT", "DATA"):
                    say("530 sign in first")
                elif word == "DATA" and not self.refuses:
                    say("354 go on")
                    await writer.drain()
                    content = (await reader.readuntil(b"\r\n.\r\n"))[:-5]
                    self.mails.append(message_from_bytes(content, policy=policy.default))
                    say("250 taken")
                elif word == "RCPT" and self.refuses:
                    say("451 not now")
                elif word == "QUIT":
                    say("221 bye")
                    break
                elif word in ("MAIL", "RCPT", "RSET", "NOOP"):
                    if word == "RCPT":
                        self.to.append(line.partition(":")[2])
                    say("250 ok")
                else:
                    say("502 not here")
                await writer.drain()
            await writer.drain()
        writer.close()


@contextlib.contextmanager
def mail_server(**options: object) -> Iterator[MailServer]:
    """One that runs, in a thread of its own."""
    served, loop, ready = MailServer(**options), asyncio.new_event_loop(), threading.Event()

    async def main() -> None:
        server = await asyncio.start_server(served.talk, served.host, 0)
        served.port = server.sockets[0].getsockname()[1]
        ready.set()
        async with server:
            await server.serve_forever()

    task = loop.create_task(main())

    def run() -> None:
        with contextlib.suppress(asyncio.CancelledError):
            loop.run_until_complete(task)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    ready.wait(10.0)
    try:
        yield served
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join(10.0)
        loop.close()
