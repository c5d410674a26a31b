"""An estimator whose machine is too slow for all that it is given: late by a few seconds at most.

Every sample is worked through as long as that is possible. A device that is late, and does not
catch up, is first published in coarser steps, which spares messages, journal and bus; filters go
on taking every sample. Where that is not enough, samples that wait are passed over up to the
newest: a hole, counted in seconds, that the estimators hear of as of any other missing samples.
What is late because much came at once, as after a start, is caught up with.

Times: CLOCK_BOOTTIME, ns, handed in, so that a test needs no clock.
"""

import logging
from dataclasses import dataclass

log = logging.getLogger(__name__)

LATE_S = 1.0  # later than this: coarser steps, unless it catches up
HOLE_S = 3.0  # later than this with coarser steps already: a hole
CATCH_UP_S = 10.0  # who will be fresh within this time catches up
FRESH_S = 0.25  # age of the oldest samples that are taken after a hole
SAY_S = 10.0
LOOK_S = 1.0  # between two looks at a device
COARSE_HZ = 5.0  # estimates per second, at most, while steps are coarser
CALM_S, LONGEST_CALM_S = 10.0, 320.0  # not late for so long: as set again; doubled at each relapse
NS = 1e-9


@dataclass
class Lateness:
    """What is known of one device."""

    late_s: float = 0.0  # newest
    coarse: bool = False
    skipped_s: float = 0.0
    holes: int = 0
    calm_s: float = CALM_S
    seen_s: float | None = None  # how late it was at the last look, if it was late
    look_ns: int = 0  # when to look again
    looked_ns: int = 0
    calm_ns: int | None = None  # since when it is not late
    skip_ns: int = 0  # what came before is passed over
    counted_ns: int = 0  # up to here samples were taken, or counted as passed over

    @property
    def limit_hz(self) -> float:
        """Estimates per second that may be published; 0: as many as are set."""
        return COARSE_HZ if self.coarse else 0.0


class Overload:
    """Decides for each device which samples are taken and in which steps is published."""

    def __init__(self) -> None:
        self._devices: dict[str, Lateness] = {}
        self._said_ns: dict[str, int] = {}  # by what was said

    def of(self, device: str) -> Lateness:
        """What is known of a device."""
        return self._devices.get(device) or Lateness()

    def forget(self, device: str) -> None:
        """The device is gone."""
        self._devices.pop(device, None)

    def take(self, device: str, at_ns: int, now_ns: int) -> bool:
        """Whether samples that came at at_ns and have their turn now are taken."""
        state = self._devices.setdefault(device, Lateness(look_ns=now_ns))
        state.late_s = max(0, now_ns - at_ns) * NS
        if now_ns >= state.look_ns:
            self._look(device, state, now_ns)
        taken = at_ns >= state.skip_ns
        if not taken:
            state.skipped_s += max(0, at_ns - state.counted_ns) * NS
        state.counted_ns = at_ns
        return taken

    def take_filled(self, device: str) -> bool:
        """Whether samples are taken that were missed and have been asked for."""
        state = self.of(device)
        return not (state.coarse and state.late_s > HOLE_S)

    def _look(self, device: str, state: Lateness, now_ns: int) -> None:
        before, since_s = state.seen_s, (now_ns - state.looked_ns) * NS
        state.look_ns, state.looked_ns = now_ns + round(LOOK_S / NS), now_ns
        state.seen_s = state.late_s if state.late_s > LATE_S else None
        if state.seen_s is None:
            self._be_calm(device, state, now_ns)
            return
        state.calm_ns = None
        if before is None:
            return  # late for the first time: is it going to catch up?
        if (before - state.seen_s) / since_s * CATCH_UP_S >= state.seen_s:
            return
        if not state.coarse:
            state.coarse = True
            what = "too slow for all; at most %g estimates a second are published"
            self._say(f"%s: %.1f s late: {what}", now_ns, device, state.late_s, COARSE_HZ)
        elif state.late_s > HOLE_S:
            self._leave_out(device, state, now_ns)

    def _leave_out(self, device: str, state: Lateness, now_ns: int) -> None:
        state.skip_ns = now_ns - round(FRESH_S / NS)
        state.seen_s = None
        state.holes += 1
        if state.holes & (state.holes - 1) == 0:
            what = "samples of %.1f s are passed over (hole %d)"
            hole_s = state.late_s - FRESH_S
            self._say(f"%s: %.1f s late: {what}", now_ns, device, state.late_s, hole_s, state.holes)

    def _say(self, text: str, now_ns: int, *values: object) -> None:
        """A line for the log, one of a kind in SAY_S: devices of one machine are late together."""
        if now_ns - self._said_ns.get(text, -round(SAY_S / NS)) >= SAY_S / NS:
            self._said_ns[text] = now_ns
            log.warning(text, *values)

    def _be_calm(self, device: str, state: Lateness, now_ns: int) -> None:
        if not state.coarse:
            return
        if state.calm_ns is None:
            state.calm_ns = now_ns
        elif (now_ns - state.calm_ns) * NS >= state.calm_s:
            state.coarse, state.calm_ns = False, None
            state.calm_s = min(2.0 * state.calm_s, LONGEST_CALM_S)
            self._say("%s: not late any more: estimates are published as set", now_ns, device)
