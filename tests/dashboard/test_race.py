"""The race table: who is scored against the tachometer, and who cannot be."""

import time

from dashboard.data.store import Store
from dashboard.scene.panels.base import Snapshot
from dashboard.scene.panels.motion.race import Race
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp

UTC = 1_700_000_000_000_000_000
TENTH = 100_000_000  # ns
DEGREE = 0.017453292519943295


class Shown(Race):
    """Keeps the HTML instead of sending it."""

    def html(self, content, handle):
        self.text = content


def page(aid: str) -> str:
    """Two seconds at 1 rad/s by the tachometer; the estimate is 2 deg/s too fast."""
    store = Store()
    for k in range(20):
        header = pb.Header(device="cube", utc_ns=UTC + k * TENTH)
        store.put(
            tp.TACHO, "cube", "", pb.TachoRate(header=header, omega_radps=1.0, direction_known=True)
        )
        rate = pb.RateBatch(
            header=header,
            estimator="products-ekf",
            omega_ib_b_radps=[0.0, 0.0, 1.0 + 2.0 * DEGREE],
            aid=aid,
        )
        store.put(tp.RATE, "cube", "products-ekf", rate)
    shown = Shown(None, None)
    shown.update(Snapshot(store, store.device("cube"), 0.0, 10.0, time.monotonic(), True))
    return shown.text


def test_an_estimate_is_scored_against_the_tachometer() -> None:
    assert "<td>2.00" in page("")


def test_an_aided_estimate_is_not_scored_by_its_own_aid() -> None:
    text = page("tachometer")
    assert "not scored: aided by the tachometer" in text and "2.00" not in text
