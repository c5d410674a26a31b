"""Quality per browser: economy is brought up to date less often, and what each gets is told."""

from dashboard.scene.pace import Pace
from dashboard.scene.workspaces import Wish
from dashboard.web.frame.flow import Flow


def turns(pace, panels, period_s, seconds=20.0):
    count = round(seconds / period_s)
    return sum(pace.due(panels, k * period_s) for k in range(count)) / seconds


def test_full_is_as_often_as_can_be_and_economy_spares_the_link():
    pace = Pace()
    assert turns(pace, False, 0.05) == 20.0 and turns(pace, True, 0.4) == 2.5
    pace = Pace()
    pace.choose(Wish.of("quality=economy&window=30").quality)
    assert 3.0 < turns(pace, False, 0.05) <= 4.1 and 0.4 <= turns(pace, True, 0.4) <= 0.55
    pace.choose(Wish.of("quality=none").quality)
    assert pace.quality == "economy"
    pace.choose(Wish.of("p=rates").quality)
    assert pace.quality == "economy"


def test_what_a_browser_took_is_its_rate(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("dashboard.web.frame.flow.time.monotonic", lambda: clock[0])
    flow = Flow()
    assert flow.rates() == (0.0, 0.0)
    for _ in range(400):
        clock[0] += 0.05
        flow.add(1000)
    updates, size = flow.rates()
    assert 19.0 < updates < 21.0 and 19_000 < size < 21_000
    clock[0] += 60.0
    assert flow.rates() == (0.0, 0.0)
