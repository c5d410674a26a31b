"""Previews: a picture over a slow link, by real Zenoh; thin, never counted as gaps, never asked
for; and the overview of what was.
"""

import math
import random
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.stack import free_port
from support.waiting import until

from dashboard.data.feed import Feed
from dashboard.data.pace import FULL, Pace
from dashboard.data.store import Store
from dashboard.scene.drawing.series import gap_mask, grid
from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.previews.frames import RATES, Frame, device_and_rate, frame_key, packed, unpacked
from messages.previews.thinning import frame_of, rounded, rows, thin
from sites.previews import Previews

RUN = 1_790_000_000_000_000_000


def accel(number: int, samples: int = 10) -> pb.AccelBatch:
    """Batch `number` of a board of 100 batches a second."""
    made = pb.AccelBatch(axes=12, period_s=0.01 / samples, first_index=number * samples)
    made.header.device, made.header.sequence, made.header.run = "cube", number + 1, RUN
    made.header.utc_ns = RUN + number * 10_000_000
    made.f_mps2.extend(float(number) + 1e-9 * k for k in range(12 * samples))
    made.counts.extend([number % 100] * 12 * samples)
    return made


@pytest.fixture
def bus() -> Iterator[BusSettings]:
    address = f"tcp/127.0.0.1:{free_port()}"
    settings = BusSettings(prefix="lab", router=address, listen=[address])
    with open_router(settings):
        yield settings


def test_a_preview_is_a_thin_picture_and_no_gap(bus: BusSettings) -> None:
    """A board of 100 batches a second is seen at 10, nothing is asked for, nothing is refused; what
    was before comes as an overview, and what was while the link was cut, too.
    """
    asked: list[str] = []
    with open_client(bus) as home, open_client(bus) as office:
        previews = Previews(home, "lab")
        history = home.declare_queryable(
            tp.published_key("lab", "*", tp.GATEWAY),
            lambda query: asked.append(str(query.key_expr)),
        )
        publishers, stop = Publishers(home, "lab"), threading.Event()
        begin_ns = time.time_ns()

        def board() -> None:
            number = 0
            while not stop.wait(0.01):
                batch = accel(number)
                batch.header.utc_ns, number = time.time_ns(), number + 1
                publishers.put(tp.ACCEL, "cube", batch)

        thread = threading.Thread(target=board)
        thread.start()
        until(lambda: len(previews.overview("cube", pb.HistoryQuery())) >= 2, "an overview")
        questions = len(asked)  # by home's own previews, when they began
        store, watched = Store(), threading.Event()
        feed = Feed(office, "lab", store, watched, live="preview", highest=10)
        try:
            until(lambda: store.devices.get("cube"), "a picture")
            device = store.devices["cube"]
            until(lambda: any(one[2] == 1.0 for one in device.thin), "what was before")
            until(lambda: device.t_newest > 1.0, "a second of the preview")
        finally:
            stop.set()
            thread.join()
            feed.stop()
            previews.close()
            history.undeclare()
        t, _ = device.window("accel", "", -1e6, 1e6)
        assert device.utc0_ns * 1e-9 + t[0] <= begin_ns * 1e-9 + 5.0, "from before it listened"
        assert np.all(np.diff(t) > 0.05), "ten a second at most"
        assert store.preview_hz == 10
        assert store.refused == 0
        assert len(asked) == questions, "a thin picture asks for nothing"


def test_frames_that_nobody_watches_are_not_made(bus: BusSettings) -> None:
    with open_client(bus) as home, open_client(bus) as office:
        previews, heard = Previews(home, "lab"), []
        publishers = Publishers(home, "lab")
        everything = office.declare_subscriber("lab/**", lambda s: heard.append(str(s.key_expr)))
        watching = office.declare_subscriber(
            frame_key("lab", "*", 5), lambda s: heard.append(str(s.key_expr))
        )
        number = 0

        def framed() -> bool:
            nonlocal number
            publishers.put(tp.ACCEL, "cube", accel(number))
            number += 1
            return any("@" in key for key in heard)

        until(framed, "a frame")
        everything.undeclare()
        watching.undeclare()
        previews.close()
        assert {key for key in heard if "@" in key} == {frame_key("lab", "cube", 5)}


@given(st.integers(1, 200), st.integers(1, 20), st.integers(1, 12))
def test_one_row_is_left_and_the_message_is_still_good(count: int, axes: int, width: int) -> None:
    """Whatever the number of axes and rows, of any width of a column that its length tells."""
    batch = pb.RateBatch(estimator="one")
    batch.header.sequence = 1
    chance = random.Random(count)
    for name, row in (("omega_ib_b_radps", 3), ("omega_covariance", 9), ("nis", 1)):
        getattr(batch, name).extend(chance.gauss(0, 1) for _ in range(count * row))
    batch.bias.extend(float(k) for k in range(count * width))
    first = list(batch.omega_ib_b_radps[:3])
    assert rows(batch) == count
    thin(batch)
    assert len(batch.omega_ib_b_radps) == 3 and len(batch.nis) == 1 and len(batch.bias) == width
    assert np.allclose(batch.omega_ib_b_radps, first, rtol=1e-7)
    other = accel(1)
    other.axes = axes
    del other.f_mps2[:], other.counts[:]
    other.f_mps2.extend([1.0] * axes * count)
    framed = frame_of(tp.ACCEL, "accel", other.SerializeToString())
    items, wrong = unpacked(packed([framed], 5), "cube")
    assert wrong is None
    assert len(pb.AccelBatch.FromString(items[0].payload).f_mps2) == axes


@given(st.lists(st.floats(width=64), min_size=1))
def test_rounding_keeps_what_is_no_number_and_24_bits_of_what_is(values: list[float]) -> None:
    for before, after in zip(values, rounded(np.array(values)), strict=True):
        if math.isfinite(before):
            assert abs(after - before) <= 6e-8 * abs(before) + 2e-315
        else:
            assert str(before) == str(float(after))


@given(st.binary(max_size=200), st.integers(0, 60))
def test_no_frame_stops_whoever_takes_it(noise: bytes, cut: int) -> None:
    good = packed([Frame("accel", RUN, 1, RUN, accel(0).SerializeToString())], 5)
    for data in (noise, good[:cut] + noise, good[:-1]):
        assert unpacked(data, "cube")[0] == []
    assert len(unpacked(good, "cube")[0]) == 1
    assert unpacked(good, "other")[0] == []  # it speaks of another device than its key


@given(st.text(max_size=60))
def test_any_key_is_no_frame_or_names_a_device_and_a_rate(key: str) -> None:
    assert device_and_rate(key) is None
    for rate in RATES:
        assert device_and_rate(frame_key("lab", "cube", rate)) == ("cube", rate)


class Link:
    """Carries so many bytes a second of frames, with a delay that wobbles; times are simulated."""

    def __init__(self, rate: float, frame: float = 1000.0, offset: float = 0.0) -> None:
        self.rate, self.frame, self.offset = rate, frame, offset
        self.free, self.chance = 0.0, random.Random(3)

    def run(self, pace: Pace, begin: float, seconds: float, wobble: float = 0.02) -> list[int]:
        """The rates chosen, one for each half second."""
        chosen, arrivals, now = [], [], begin
        while now < begin + seconds:
            period = 1.0 / (pace.rate if pace.rate != FULL else 200)
            self.free = max(self.free, now) + self.frame / self.rate
            arrivals.append((self.free + 0.1 + self.chance.random() * wobble, now))
            while arrivals and arrivals[0][0] <= now:
                at, sent = arrivals.pop(0)
                pace.came(at, at - sent + self.offset)
            if not chosen or now - begin >= 0.5 * len(chosen):
                chosen.append(pace.choose(now))
            now += period
        return chosen


@pytest.mark.parametrize("offset", [-1e6, 0.0, 30.0])  # clocks that nobody has compared
def test_the_rate_follows_what_the_link_carries(offset: float) -> None:
    pace = Pace(50, may_be_full=True)
    found = Link(15_000.0, offset=offset).run(pace, 0.0, 400.0)  # 15 frames a second
    assert max(found) <= 20 and 0 not in found
    assert np.median(found[40:]) == 10
    assert found.count(20) < len(found) / 6, "what was too much is not tried again and again"


def test_a_rate_that_is_far_too_much_is_left_at_once_for_what_comes_through() -> None:
    pace, link = Pace(50, may_be_full=False), Link(1e7)
    assert link.run(pace, 0.0, 120.0)[-1] == 50
    link.rate = 8_000.0  # 8 frames a second
    found = link.run(pace, 120.0, 12.0)
    assert not {20, 10} & set(found), "no step in between"
    assert found[-1] <= 5


def test_a_link_that_carries_everything_gets_everything() -> None:
    pace = Pace(50, may_be_full=True)
    assert Link(1e7).run(pace, 0.0, 120.0)[-1] == FULL
    pace = Pace(50, may_be_full=False)
    assert Link(1e7).run(pace, 0.0, 120.0)[-1] == 50


def test_a_link_that_becomes_slow_is_followed_and_a_cut_is_no_slow_link() -> None:
    pace, link = Pace(50, may_be_full=True), Link(1e7)
    link.run(pace, 0.0, 120.0)
    link.rate = 3_000.0
    assert 1 <= link.run(pace, 120.0, 120.0)[-1] <= 2
    before = pace.rate
    assert pace.choose(700.0) == before  # ten minutes without a frame


def test_a_thin_stretch_is_no_gap_and_a_cut_in_it_is_one() -> None:
    """50 samples a second, then one, then a cut of 30 s, then one again."""
    t = np.concatenate([np.arange(0, 60, 0.02), np.arange(60, 120, 1.0), np.arange(150, 200, 1.0)])
    edges, x = grid(0.0, 200.0)
    plain = gap_mask(t, edges, 0.25)
    mask = gap_mask(t, edges, 0.25, [[60.0, 119.0, 1.0], [150.0, 199.0, 1.0]])
    assert plain[(x > 61) & (x < 119)].any(), "that is what it would look like"
    assert not mask[x < 119].any() and not mask[x > 150].any()
    assert mask[(x > 121) & (x < 148)].all()
