"""[alarms] of gyrofree.toml."""

from pathlib import Path
from typing import Annotated, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, model_validator

from messages.contract.names import Name
from messages.setting import setting

LEVELS = ("watch", "warning", "critical")
OFF = "off"
NUMBER = 1e12  # no limit is larger


def _one_of(*words: str) -> AfterValidator:
    def check(text: str) -> str:
        if text not in words:
            raise ValueError(f"{text!r}: want {', '.join(words[:-1])} or {words[-1]}")
        return text

    return AfterValidator(check)


Level = Annotated[str, _one_of(*LEVELS)]
LevelOrOff = Annotated[str, _one_of(OFF, *LEVELS)]
Unknown = Annotated[str, _one_of("say", "alarm")]
Safety = Annotated[str, _one_of("starttls", "tls", "none")]


class LimitSettings(BaseModel):
    """A number of a device that is to stay within limits."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Name = setting(..., "of the alarm; no two have the same")
    field: str = setting(
        ...,
        "a channel of the charts (`omega_z`, `tachometer`, `a1_x`), an expression of such, or"
        " `topic.field` (`link.latency_p99_s`, `nav.ekf.sigma[6]`)",
        min_length=1,
        max_length=200,
    )
    device: Name | None = setting(None, "of the field; none: every device that has it")
    above: float | None = setting(
        None, "an alarm beyond it, in the field's unit", ge=-NUMBER, le=NUMBER
    )
    below: float | None = setting(None, "an alarm below it", ge=-NUMBER, le=NUMBER)
    dead_band: float = setting(
        0.0, "the alarm ends when the value is so far inside of its limit", ge=0, le=NUMBER
    )
    on_delay_s: float = setting(
        0.0, "beyond the limit for so long, by the device's clock", unit="s", ge=0, le=86400
    )
    off_delay_s: float = setting(0.0, "likewise inside, before it ends", unit="s", ge=0, le=86400)
    level: Level = setting("warning", "watch, warning or critical")
    unknown: Unknown = setting(
        "say",
        "of a value that is not known (blind, stale, none): `say` it, or have an `alarm` of it",
    )
    unit: str = setting(
        "", "that the numbers are meant in; another unit of the field is said", max_length=16
    )

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        if self.above is None and self.below is None:
            raise ValueError("a limit wants above, below or both")
        if self.above is not None and self.below is not None:
            if self.above - self.below <= 2.0 * self.dead_band:
                raise ValueError(
                    f"between below = {self.below:g} and above = {self.above:g} there is no room"
                    f" for a dead band of {self.dead_band:g} on either side: it could never end"
                )
        return self


class HealthSettings(BaseModel):
    """Which level each fault of the bench has; `off` for none."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    link: LevelOrOff = setting("critical", "the board is not connected, or its gateway is silent")
    line: LevelOrOff = setting(
        "watch", "the gateway has something to say of the board, as that its receiver has no place"
    )
    table: LevelOrOff = setting("critical", "a driven table may turn and nobody holds it")
    recorder: LevelOrOff = setting(
        "critical", "the recording failed, the recorder is silent, or a procedure is not recorded"
    )
    disk: LevelOrOff = setting("critical", "little room on the recordings' disk, or a full one")
    axis: LevelOrOff = setting("warning", "an accelerometer axis is stuck, swapped or biased")
    board: LevelOrOff = setting("warning", "the board rebooted, or names a fault of its own")
    estimator: LevelOrOff = setting("warning", "an estimator is silent, or says what is wrong")
    late: LevelOrOff = setting("warning", "estimates come late, or less often than they should")
    contradicted: LevelOrOff = setting("warning", "the data contradict the leading filter")
    inconsistent: LevelOrOff = setting(
        "warning", "its errors are larger than the leading filter believes (NIS)"
    )
    clock: LevelOrOff = setting(
        "watch",
        "the gateway's clock was set while it ran, a place's is off, or its offset is not known",
    )
    twin: LevelOrOff = setting("critical", "two gateways want one board")
    service: LevelOrOff = setting("warning", "a service hangs, is frozen, or gone without a word")
    place: LevelOrOff = setting("watch", "nothing is heard of another place of the site")
    certificate: LevelOrOff = setting(
        "warning", "a certificate is near its end and was not renewed by itself"
    )
    blind: LevelOrOff = setting("watch", "the leading filter sees no component of the rate")
    settings: LevelOrOff = setting("watch", "the data contradict a setting")


class WebhookSettings(BaseModel):
    """A server that is told of alarms by POST, as JSON."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    url: str = setting(..., "http or https", max_length=1000)
    secret_file: Path | None = setting(
        None, "file whose first line signs every notice (HMAC-SHA256, `X-Gyrofree-Signature`)"
    )
    level: Level = setting("warning", "the least that is told")
    timeout_s: float = setting(5.0, "of one attempt", unit="s", gt=0, le=60)

    @model_validator(mode="after")
    def _is_a_web_address(self) -> Self:
        try:
            parts = urlsplit(self.url)
            sound = parts.scheme in ("http", "https") and bool(parts.hostname)
            sound = sound and parts.port != 0
        except ValueError:
            sound = False
        if not sound:
            raise ValueError(f"url = {self.url!r}: want http://HOST/... or https://HOST/...")
        return self


class MailSettings(BaseModel):
    """A mail server that notices of alarms are given to."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    host: str = setting(..., "of the mail server", min_length=1, max_length=255)
    port: int = setting(587, "of it", ge=1, le=65535)
    safety: Safety = setting(
        "starttls", "`starttls`, `tls` from the start, or `none`, which is read by whoever listens"
    )
    sender: str = setting(..., "address that they come from", min_length=3, max_length=254)
    to: list[str] = setting(..., "addresses that they go to", min_length=1, max_length=20)
    user: str = setting("", "name at the server; empty: it asks for none", max_length=254)
    password_file: Path | None = setting(None, "file whose first line is the password")
    level: Level = setting("critical", "the least that is told")
    timeout_s: float = setting(10.0, "of one attempt", unit="s", gt=0, le=60)

    @model_validator(mode="after")
    def _are_addresses(self) -> Self:
        for one in (self.sender, *self.to):
            if "@" not in one.strip("@") or not one.isascii() or not one.isprintable():
                raise ValueError(f"{one!r} is no address")
            if set(one) & set(" <>,;"):
                raise ValueError(f"{one!r}: want the bare address, as lab@example.org")
        return self


class AlarmSettings(BaseModel):
    """What is an alarm, who is told, and where it is kept."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    state: Path = setting(
        Path("var/state/alarms.json"),
        "states, history and the limits set on the page; notices that wait lie beside it",
        shown=True,
    )
    disk_free_bytes: int = setting(
        2 << 30, "an alarm below so much room for recordings", unit="bytes", ge=0
    )
    clock_limit_s: float = setting(
        0.5, "an alarm where a clock is surely further from the site's", unit="s", gt=0
    )
    certificate_days: float = setting(
        14.0,
        "an alarm when a certificate has less than that left, or less than a sixth of its life",
        unit="days",
        ge=0,
    )
    on_delay_s: float = setting(
        0.5, "a fault of the bench is an alarm when it has been there for so long", unit="s", ge=0
    )
    off_delay_s: float = setting(
        2.0, "and has ended when it has been gone for so long", unit="s", ge=0
    )
    health: HealthSettings = setting(HealthSettings(), "Levels of the faults of the bench")
    limits: list[LimitSettings] = setting([], "limits on numbers, a block for each", max_length=200)
    webhook: WebhookSettings | None = setting(None, "a server that is told")
    mail: MailSettings | None = setting(None, "people who are told by mail")

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [one.name for one in self.limits]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two limits are called {', '.join(twice)}")
        return self
