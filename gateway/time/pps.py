"""The board's clock against the receiver's pulse per second: two pulses k seconds apart are k
seconds apart.

Unlike receipts on the host this sees no transport, so a second shows the skew to about 1 ppm and
ten to 0.1 ppm.
"""

from collections import deque

WINDOW = 60  # pulses
MAX_SKEW = 2e-3  # a pulse further off than this is a glitch or a wrong second


class PpsClock:
    """Skew of the device clock from PPS frames."""

    def __init__(self) -> None:
        self.pulses = 0  # taken
        self.rejected = 0
        self.reset()

    def reset(self) -> None:
        """The board has restarted."""
        self._pulses: deque[tuple[int, float]] = deque(
            maxlen=WINDOW
        )  # (whole seconds since the first, device time s)

    def add(self, device_us: int, fraction_ns: int) -> None:
        """One pulse at device_us + fraction_ns."""
        at = device_us * 1e-6 + fraction_ns * 1e-9
        if not self._pulses:
            self._pulses.append((0, at))
            self.pulses += 1
            return
        last_second, last = self._pulses[-1]
        step = round(at - last)
        if step < 1 or abs((at - last) / step - 1.0) > MAX_SKEW:
            self.rejected += 1
            if self.rejected % 5 == 0:  # the pulses that were kept are the wrong ones
                self._pulses.clear()
            return
        self.pulses += 1
        self._pulses.append((last_second + step, at))

    @property
    def span_s(self) -> float:
        """Seconds between the first and the last pulse of the window."""
        return float(self._pulses[-1][0] - self._pulses[0][0]) if self._pulses else 0.0

    @property
    def skew_ppm(self) -> float:
        """Device clock against the receiver's, ppm; positive when the device runs fast; 0 before
        two pulses.
        """
        if self.span_s == 0.0:
            return 0.0
        return ((self._pulses[-1][1] - self._pulses[0][1]) / self.span_s - 1.0) * 1e6
