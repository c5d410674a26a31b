"""What is known of one device: the newest message of each topic, tables over time, tracks."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from google.protobuf.message import Message

from dashboard.data.ring import Ring, blank
from dashboard.data.tables import TABLES
from dashboard.data.track import Track

LEADERS = (  # estimators that stand first wherever they run
    "products-ekf",
    "products-free",
    "huber-nhc",
    "ekf",
)
HISTORY_S = 620.0  # kept in the rings; the longest window a view offers is 600 s
STALE_S = 1.0  # a value older than this is greyed
PREVIEW_PAUSES = 3.0  # of a preview's rows, before what it shows is greyed, too
SLOW_STALE_S = {
    "link": 3.0,
    "status": 3.0,
    "estimator": 3.0,
    "board": 30.0,
    "procedure": 5.0,
    "alarm": 6.0,
    "gnss": 2.5,
    "sky": 5.0,
    "innovation": 10.0,
}

# Estimates that just came, but of samples that came so long before, are no present state either.
BEHIND_STALE_S = 2.0
ESTIMATED = ("rate", "nav", "attitude")


def _rank(estimator: str) -> tuple[bool, str]:
    """Order of estimators; the leading ones first."""
    return estimator not in LEADERS, estimator


@dataclass
class Latest:
    """The newest message of one topic (and estimator) and when it came."""

    message: Message
    arrived: float  # time.monotonic(), s
    t: float  # s on the device's axis

    def age(self, now: float | None = None) -> float:
        """Seconds since it arrived."""
        return (time.monotonic() if now is None else now) - self.arrived


@dataclass
class Device:
    """`latest` and `rings` are keyed by topic name and estimator ('' where there is none)."""

    name: str
    utc0_ns: int
    latest: dict[tuple[str, str], Latest] = field(default_factory=dict)
    rings: dict[tuple[str, str], Ring] = field(default_factory=dict)
    tracks: dict[str, Track] = field(default_factory=dict)
    fixes: dict[int, tuple[float, ...]] = field(default_factory=dict)  # newest p_n, by sequence
    t_newest: float = 0.0
    t_first: float = 0.0  # below zero when older data were fetched
    late: list[list[float]] = field(default_factory=list)  # stretches [from, until] filled in, s
    thin: list[list[float]] = field(default_factory=list)  # [from, until, one row in so many s]
    marks: list[tuple[float, str]] = field(default_factory=list)  # notes: when, s, and their text
    origin: tuple[float, float, float] | None = None  # of n: latitude deg, longitude deg, height m
    run: int = 0
    may_grow: Callable[[int], bool] = lambda _: True  # see Ring
    doubted: dict[tuple[str, str], int] = field(default_factory=dict)  # times of messages, utc_ns
    born: float = field(default_factory=time.monotonic)  # s; when it was first heard of
    generation: int = 0  # counts the times everything was forgotten because time jumped back

    @property
    def is_vehicle(self) -> bool:
        """A board with gyroscopes, as against a cube of accelerometers, which may navigate too."""
        if ("imu", "") in self.latest or ("adc", "") in self.latest:
            return True
        return ("accel", "") not in self.latest and self.navigates

    @property
    def body(self) -> str:
        """Topic of the estimates that move its body in the scene: nav of a vehicle, attitude of a
        board, else rate.
        """
        if not self.is_vehicle:
            return "rate"
        return "attitude" if not self.navigates and self.estimators("attitude") else "nav"

    @property
    def navigates(self) -> bool:
        """Some navigation filter runs for it."""
        return any(topic == "nav" for topic, _ in self.latest)

    @property
    def spoken_of(self) -> bool:
        """Its gateway or an estimator has said how it is."""
        return any(topic in ("link", "board", "estimator") for topic, _ in self.latest)

    @property
    def heard(self) -> float:
        """When the newest message came, time.monotonic(), s."""
        return max((latest.arrived for latest in self.latest.values()), default=0.0)

    @property
    def nbytes(self) -> int:
        """Memory of the rings."""
        return sum(ring.nbytes for ring in self.rings.values())

    def estimators(self, topic: str) -> list[str]:
        """Names of the estimators heard on a topic; the leading one first."""
        names = [estimator for name, estimator in self.latest if name == topic]
        return sorted(names, key=_rank)

    def leads(self, topic: str, estimator: str) -> bool:
        """Does none of those heard come before it? What is filled in from before may be the first
        that is heard.
        """
        return all(_rank(estimator) <= _rank(name) for name in self.estimators(topic))

    def get(self, topic: str, estimator: str = "") -> Latest | None:
        """Newest message of a topic."""
        return self.latest.get((topic, estimator))

    def stale(self, topic: str, estimator: str = "", now: float | None = None) -> bool:
        """True when there is none or it is older than its topic allows."""
        latest = self.get(topic, estimator)
        limit_s = max(SLOW_STALE_S.get(topic, STALE_S), PREVIEW_PAUSES * self.thinned_s)
        old = latest is None or latest.age(now) > limit_s
        return old or (topic in ESTIMATED and self.behind_s(estimator) > BEHIND_STALE_S)

    @property
    def thinned_s(self) -> float:
        """Between two rows of the preview that comes now, s; 0: everything comes."""
        last = self.thin[-1] if self.thin else (0.0, -math.inf, 0.0)
        return last[2] if self.t_newest - last[1] < PREVIEW_PAUSES * last[2] else 0.0

    def behind_s(self, estimator: str) -> float:
        """By how much an estimator says that it is behind its samples, s."""
        status = self.get("estimator", estimator)
        return 0.0 if status is None else float(status.message.behind_s)

    def ring(self, topic: str, estimator: str, **widths: int) -> Ring:
        """The ring of a topic, made at first use; `widths` of columns that depend on the device."""
        key, table = (topic, estimator), TABLES[topic]
        if key not in self.rings:
            self.rings[key] = Ring(
                table.dtype(**widths), int(HISTORY_S * table.rate), self.may_grow
            )
        return self.rings[key]

    def window(
        self, topic: str, estimator: str, t0: float, t1: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) s and rows (n,) of a topic in a window, its columns as tables.py names them.

        Views of the ring: read them under the store's lock. Empty when there are none.
        """
        ring = self.rings.get((topic, estimator))
        rows = ring.window(t0, t1) if ring else blank(TABLES[topic].dtype(), 0)
        return rows["t"], rows
