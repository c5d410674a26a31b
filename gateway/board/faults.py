"""What is wrong on a board, by name: from HELLO and STATUS, from the samples themselves, and from
the line.

    sensor-N-dead     the board has taken sensor N out of its frames
    sensor-N-errors   its transfers or starts fail
    sensor-N-stuck    its three axes have not changed for STUCK_S while another sensor's have
    sensor-N-stale    more than half of its samples in a second repeat an old value
    sensor-N-overrun  its FIFO overflows although it is sampled no faster than it is read
    uart-stall        the board built frames that its line did not take, or the line fell silent
    samples-missed    sampling instants without a sample, or samples without a frame
    tacho-overflow    pulses came faster than the board could keep
    commands-damaged  bytes from the host arrived broken
    reboot            the board has started anew
    clock-skew        its clock differs from the host's by more than SKEW_PPM
    stack-low, cpu-overload   little is left of either

A fault is active as long as its cause is seen (events: for ACTIVE_S), and is told for KEEP_S after
that. Sensors count from 1, as the triads do. All times are given to it, so a recording gives the
same faults.
"""

from dataclasses import dataclass, field

from firmware_protocol.frames import Acc12, Hello, Status
from messages.contract import gyrofree_pb2 as pb

ACTIVE_S = 3.0
KEEP_S = 10.0
SILENT_S = 0.5
STUCK_S = 2.0
SKEW_PPM, SKEW_WINDOW_S, CRYSTAL_PPM = (
    100.0,
    20.0,
    2000.0,
)  # beyond CRYSTAL_PPM it is no crystal: time_scale is wrong
LOW_STACK, FULL_PERMILLE = 512, 900
TOP_RATE_HZ = 3200.0  # of an ADXL345, rate code 15
WRAP = 1 << 32
SENSORS = 4

EVENTS = {  # counter of STATUS: name of the fault, what it means
    "missed_ticks": (
        "samples-missed",
        "sampling instants without a sample: the board is too busy; sample slower",
    ),
    "sample_drops": (
        "samples-missed",
        "samples that found no frame: the line is too slow; raise its baud",
    ),
    "dropped": (
        "uart-stall",
        "frames dropped by the board: its line did not take them; raise baud or sample slower",
    ),
    "tacho_overflow": (
        "tacho-overflow",
        "pulses lost to a full buffer: the table turns too fast for its disc",
    ),
    "rx_bad": (
        "commands-damaged",
        "damaged chunks from the host: check ground and baud of the line",
    ),
    "uart_errors": (
        "commands-damaged",
        "framing or overrun errors on the board's receiver: check ground and baud",
    ),
}


@dataclass
class _Fault:
    text: str
    since_ns: int
    active_until_s: float


@dataclass
class _Sensor:
    last: tuple[int, ...] = ()
    same_since_s: float = 0.0
    samples: int = 0
    stale: int = 0


@dataclass
class FaultWatch:
    """Faults of one board. Times: now_s monotonic, utc_ns for people."""

    _faults: dict[str, _Fault] = field(default_factory=dict)
    _status: Status | None = None
    _hello: Hello | None = None
    _sensors: list[_Sensor] = field(default_factory=lambda: [_Sensor() for _ in range(SENSORS)])
    _judged_s: float = 0.0
    _heard_s: float | None = None
    _changed: bool = False

    def rebooted(self, now_s: float, utc_ns: int, text: str) -> None:
        """Another boot; the first one heard of is none."""
        self._status = self._hello = None
        self._sensors = [_Sensor() for _ in range(SENSORS)]
        self._see("reboot", text, now_s, utc_ns, ACTIVE_S)

    def hello(self, hello: Hello) -> None:
        """A HELLO of this boot."""
        self._hello = hello

    def heard(self, now_s: float, utc_ns: int, late: bool = False) -> None:
        """A frame has come: how long was it silent? late: the frame may have waited for this
        process, and nothing is known of the line.
        """
        if not late and self._heard_s is not None and now_s - self._heard_s > SILENT_S:
            self._see(
                "uart-stall",
                f"the line was silent for {now_s - self._heard_s:.1f} s",
                now_s,
                utc_ns,
                ACTIVE_S,
            )
        self._heard_s = now_s

    def stopped(self, seconds: float) -> None:
        """Nobody looked for so long."""
        if self._heard_s is not None:
            self._heard_s += seconds
        for sensor in self._sensors:
            sensor.same_since_s += seconds

    def samples(self, frame: Acc12, now_s: float, utc_ns: int) -> None:
        """One data frame: who is dead, stuck or stale?"""
        fresh = False
        for k, sensor in enumerate(self._sensors):
            if not frame.sensor_mask >> k & 1:
                self._see(
                    f"sensor-{k + 1}-dead",
                    "the board gets no answer from it: check its cable, its supply and "
                    "the chip select",
                    now_s,
                    utc_ns,
                    ACTIVE_S,
                )
                sensor.last = ()
                continue
            n = len(frame.counts)
            sensor.samples += n
            sensor.stale += n if frame.stale_mask >> k & 1 else 0
            newest = frame.counts[-1][3 * k : 3 * k + 3]
            if newest != sensor.last or any(
                row[3 * k : 3 * k + 3] != newest for row in frame.counts
            ):
                sensor.last, sensor.same_since_s, fresh = newest, now_s, True
        if fresh and now_s - self._judged_s >= 1.0:
            self._judged_s = now_s
            self._judge(now_s, utc_ns)

    def _judge(self, now_s: float, utc_ns: int) -> None:
        """Once a second; only while at least one sensor shows that the world moves or noise is
        there.
        """
        for k, sensor in enumerate(self._sensors, 1):
            if sensor.last and now_s - sensor.same_since_s > STUCK_S:
                text = (
                    f"its three axes have read {sensor.last} for {now_s - sensor.same_since_s:.0f}"
                    " s: replace it"
                )
                self._see(f"sensor-{k}-stuck", text, now_s, utc_ns, ACTIVE_S)
            elif sensor.samples and 2 * sensor.stale > sensor.samples:
                text = (
                    f"{sensor.stale} of {sensor.samples} samples repeat an old value: it samples"
                    " too slowly"
                )
                self._see(f"sensor-{k}-stale", text, now_s, utc_ns, ACTIVE_S)
            sensor.samples = sensor.stale = 0

    def status(self, status: Status, now_s: float, utc_ns: int) -> None:
        """A STATUS: which counters have grown since the one before (or since boot)?"""
        before, self._status = self._status or Status(), status
        for counter, (name, text) in EVENTS.items():
            grown = (getattr(status, counter) - getattr(before, counter)) % WRAP
            if grown:
                self._see(name, f"{grown} {text}", now_s, utc_ns, ACTIVE_S)
        for k in range(SENSORS):
            errors = sum(
                (getattr(status, c)[k] - getattr(before, c)[k]) % WRAP
                for c in ("spi_errors", "init_errors")
            )
            if errors:
                self._see(
                    f"sensor-{k + 1}-errors",
                    f"{errors} failed transfers or starts since the last STATUS",
                    now_s,
                    utc_ns,
                    ACTIVE_S,
                )
            overruns = (status.fifo_overruns[k] - before.fifo_overruns[k]) % WRAP
            if overruns and self._hello is not None and not self._samples_faster(k):
                self._see(
                    f"sensor-{k + 1}-overrun",
                    f"{overruns} overflows of its FIFO: the board reads too slowly",
                    now_s,
                    utc_ns,
                    ACTIVE_S,
                )
        if 0 < status.free_stack < LOW_STACK:
            self._see(
                "stack-low",
                f"{status.free_stack} bytes of stack were never used",
                now_s,
                utc_ns,
                ACTIVE_S,
            )
        if status.cpu_permille > FULL_PERMILLE:
            text = (
                f"the processor is busy {status.cpu_permille / 10:.0f} % of the time: sample slower"
            )
            self._see("cpu-overload", text, now_s, utc_ns, ACTIVE_S)

    def _samples_faster(self, k: int) -> bool:
        """True when a sensor samples faster than it is read, so that values not read are what was
        asked for.
        """
        hello = self._hello
        rate = TOP_RATE_HZ / 2.0 ** (15 - (hello.sensors[k].rate_code & 15))
        return rate * hello.sample_period_ns * 1e-9 > 0.97

    def line(
        self,
        connected: bool,
        skew_ppm: float,
        doubt_ppm: float,
        window_s: float,
        now_s: float,
        utc_ns: int,
        silent_s: float | None = None,
    ) -> None:
        """Once a second: what only the line shows. doubt_ppm: by how much the skew may be wrong;
        silent_s: for how long the port was seen to have nothing, by the last frame if it is None.
        """
        if silent_s is None:
            silent_s = 0.0 if self._heard_s is None else now_s - self._heard_s
        if connected and self._heard_s is not None and silent_s > SILENT_S:
            text = f"the line is open and silent for {silent_s:.1f} s: has the board stopped?"
            self._see("uart-stall", text, now_s, utc_ns, 1.5)
        if window_s >= SKEW_WINDOW_S and SKEW_PPM + doubt_ppm < abs(skew_ppm) < CRYSTAL_PPM:
            text = (
                f"its clock runs {skew_ppm:+.0f} ppm against the host's: check the crystal (and the"
                " host's NTP)"
            )
            self._see("clock-skew", text, now_s, utc_ns, ACTIVE_S)

    def _see(self, name: str, text: str, now_s: float, utc_ns: int, active_s: float) -> None:
        fault = self._faults.get(name)
        if fault is None or now_s > fault.active_until_s:
            self._faults[name] = _Fault(text, utc_ns, now_s + active_s)
            self._changed = True
        else:
            fault.text, fault.active_until_s = text, now_s + active_s

    def news(self) -> bool:
        """True once after a fault has come."""
        changed, self._changed = self._changed, False
        return changed

    def messages(self, now_s: float) -> list[pb.Fault]:
        """All present or recent ones, newest first."""
        self._faults = {n: f for n, f in self._faults.items() if now_s <= f.active_until_s + KEEP_S}
        ordered = sorted(self._faults.items(), key=lambda item: (-item[1].since_ns, item[0]))
        return [
            pb.Fault(name=n, text=f.text, since_utc_ns=f.since_ns, active=now_s <= f.active_until_s)
            for n, f in ordered
        ]
