"""A recording read into curves: `build`, and a program of its own for whoever must not wait.

    python -m sessions.library.curves_build RECORDING.mcap

writes curves.npz beside the recording and prints the share done, a number per line.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from google.protobuf.message import DecodeError, Message
from numpy.typing import NDArray

from inertial.rate.names import LEADER
from logs.figures.names import axis_channel
from messages.contract.topics import (
    ACCEL,
    ALARM,
    ALARMS,
    GNSS,
    IMU,
    NAV,
    NOTE,
    RATE,
    TACHO,
    TRUTH,
    Topic,
    parse,
)
from sessions.library.alarmed import Episodes
from sessions.library.curves import Curves, Line, Mark, bin_for, bins_of, load, save
from sessions.library.curves_bins import UNTOLD, Binner, PulseLine, TrackLine
from sessions.library.scan import Block, Extent, Progress, extent, scan
from sessions.recording.manifest import SessionError, name_of, read_manifest
from sessions.recording.mcap_damage import Damage
from sessions.recording.mcap_log import say
from sessions.recording.samples import Samples, decode, samples

Array = NDArray[np.float64]

PLACE = ("latitude_deg", "longitude_deg", "height_m")
TURN = ("omega_ib_b_radps", "angle_z_rad")
WANTED: dict[Topic, tuple[str, ...]] = {  # and which of their fields
    RATE: (*TURN, "sight"),
    IMU: ("omega_ib_b_radps", "f_b_mps2"),
    ACCEL: ("f_mps2",),
    TACHO: ("omega_radps",),
    TRUTH: TURN,
    NAV: ("p_ned_m", "sigma", "position_covariance", *(f"origin_{name}" for name in PLACE)),
    GNSS: ("quality", "position_sigma_ned_m", *PLACE),
    NOTE: ("text", "author", "seconds", "at_utc_ns"),
}
STRAY_S = (
    5.0  # a sample whose own time lies further outside the recording is put where it was received
)
NO_PLACE_M = 1e4  # one sigma, from which a place is none
COARSE_CHUNKS = 250  # read for the first look at a recording ...
COARSE_THIN = 4  # ... and of those one message in so many
LONG_CHUNKS = 4 * COARSE_CHUNKS  # a recording of more gets one


def build(path: Path, coarse: bool = False, on_progress: Progress = lambda _: None) -> Curves:
    """Curves of a recording; `coarse`: of evenly spaced parts of it only.

    Raises OSError, and ValueError for a file without any message.
    """
    found = extent(path)
    stride = max(1, found.chunks // COARSE_CHUNKS) if coarse else 1
    reading = _Reading(path, found, stride)
    damage = Damage()
    for block in scan(path, (*WANTED, ALARM), stride, on_progress, damage):
        reading.take(
            block
            if stride == 1
            else Block(block.key, block.log_ns[::COARSE_THIN], block.payloads[::COARSE_THIN])
        )
    say(path, damage)
    return replace(reading.result(), said=tuple(damage.said()))


def ensure(path: Path, on_progress: Progress = lambda _: None) -> Curves:
    """The kept curves, or new ones, kept if the folder can be written. Raises what build raises."""
    kept = load(path)
    if kept is not None:
        return kept
    made = build(path, on_progress=on_progress)
    try:
        save(made, path)
    except OSError:
        pass  # a read-only archive is compared all the same, only slower
    return made


class _Reading:
    """What has been read so far."""

    def __init__(self, path: Path, found: Extent, stride: int) -> None:
        self._path, self._extent, self._coarse = path, found, stride > 1
        least = 1.1 * found.seconds * stride / found.chunks if self._coarse else 0.0
        self._least_s = least  # width of bins, at least, s
        self._bin_s = 0.0  # known with the first samples
        self._lines: dict[str, Binner] = {}
        self._pulses: dict[str, PulseLine] = {}
        self._axes: dict[str, tuple[Binner, tuple[str, ...]]] = {}
        self._tracks: dict[str, TrackLine] = {}
        self._marks: list[Mark] = []
        self._alarms = Episodes()
        self._clocks: set[str] = set()
        self._take: dict[str, Callable[[str, Samples, Array], None]] = {
            RATE.name: self._rate,
            TRUTH.name: self._truth,
            IMU.name: self._imu,
            ACCEL.name: self._accel,
            TACHO.name: self._tacho,
            NAV.name: self._nav,
            GNSS.name: self._gnss,
            NOTE.name: self._note,
        }

    def take(self, block: Block) -> None:
        """One block of messages of one key; those that cannot be decoded are left out."""
        address = parse(block.key)
        decoded = list(_decoded(address.topic, block))
        if not decoded:
            return
        topic, (log_ns, found) = address.topic, zip(*decoded, strict=True)
        if topic is ALARM:
            for status in found:
                self._alarms.take(status)
            return
        read = samples(topic, found, log_ns, (*WANTED[topic], "run", "epoch"))
        name = f"{address.device}/{topic.name}" + (
            f"/{address.estimator}" if address.estimator else ""
        )
        for run, epoch in {(read.header["run"][k], read.header["epoch"][k]) for k in (0, -1)}:
            if topic is not NOTE and run:
                self._clocks.add(f"{address.device}/{run}/{epoch}")
        self._take[topic.name](name, read, self._times(read))

    def result(self) -> Curves:
        """All of it, on one grid."""
        seconds = max(self._extent.seconds, 1e-3)
        width = self._bin_s or bin_for(seconds, max(self._least_s, 0.01))
        n = bins_of(seconds, width)
        lines = {key: binner.line(n) for key, binner in self._lines.items()}
        dark = {key: _dark(key, lines) for key in self._pulses}
        lines |= {
            key: pulses.line(n, width, self._coarse, dark[key])
            for key, pulses in self._pulses.items()
        }
        tracks = {key: track.track() for key, track in self._tracks.items()}
        return Curves(
            name_of(self._path),
            self._extent.first_ns,
            seconds,
            width,
            dict(sorted(lines.items())),
            dict(sorted(tracks.items())),
            tuple(sorted(self._marks + self._alarmed(), key=lambda mark: mark.t)),
            tuple(sorted(self._clocks)),
            self._coarse,
            leader_of(self._path),
            {key: _means(*one, n) for key, one in self._axes.items()},
        )

    def _alarmed(self) -> list[Mark]:
        ranges = self._alarms.ranges(self._extent.first_ns, self._extent.last_ns)
        return [Mark(t, text, ALARMS, seconds) for t, text, seconds in ranges]

    def _times(self, read: Samples) -> Array:
        """The samples' own times, s from the first message; receive times where those cannot be."""
        own = (read.utc_ns - self._extent.first_ns) / 1e9
        received = (read.log_ns - self._extent.first_ns) / 1e9
        stray = (own < -STRAY_S) | (own > self._extent.seconds + STRAY_S)
        return np.where(stray, received, own) + read.after_s

    def _binner(self, key: str, t: Array, width: int) -> Binner:
        if key not in self._lines:
            self._lines[key] = self._new_binner(key, t, width)
        return self._lines[key]

    def _new_binner(self, key: str, t: Array, width: int) -> Binner:
        if not self._bin_s:
            period = float(np.median(np.diff(t))) if len(t) > 2 else 0.01
            self._bin_s = bin_for(self._extent.seconds, max(self._least_s, period))
        return Binner(key, self._extent.seconds, self._bin_s, width)

    def _rate(self, key: str, read: Samples, t: Array) -> None:
        omega, angle = read.fields["omega_ib_b_radps"], read.fields["angle_z_rad"]
        if (read.lengths["omega_ib_b_radps"] == 3).all():
            self._binner(key, t, 4).add(t, np.column_stack([omega, angle]), _sight(read))

    _truth = _rate

    def _imu(self, key: str, read: Samples, t: Array) -> None:
        omega = read.fields["omega_ib_b_radps"]
        if (read.lengths["omega_ib_b_radps"] == 3).all():
            self._binner(key.replace("/imu", "/gyro"), t, 3).add(t, omega)
        if (read.lengths["f_b_mps2"] == 3).all():
            names = tuple(f"f_{axis}" for axis in "xyz")
            self._force(key.replace("/imu", "/force"), names, t, read.fields["f_b_mps2"])

    def _accel(self, key: str, read: Samples, t: Array) -> None:
        f = read.fields["f_mps2"]
        if f.shape[1]:
            names = tuple(axis_channel(k) for k in range(f.shape[1]))
            self._force(key.replace("/accel", "/axes"), names, t, f)

    def _force(self, key: str, names: tuple[str, ...], t: Array, f: Array) -> None:
        """Readings of accelerometers; of an array that has got other axes the first ones are
        kept.
        """
        width = len(names)
        if key not in self._axes:
            self._axes[key] = (self._new_binner(key, t, width), names)
        binner, known = self._axes[key]
        if known == names:
            binner.add(t, f)

    def _tacho(self, key: str, read: Samples, t: Array) -> None:
        self._pulses.setdefault(key, PulseLine(key)).add(t, read.fields["omega_radps"])

    def _nav(self, key: str, read: Samples, t: Array) -> None:
        latitude, longitude, height = (read.fields[f"origin_{name}"] for name in PLACE)
        known = (read.lengths["p_ned_m"] == 3) & ((latitude != 0) | (longitude != 0))
        certain = read.lengths["position_covariance"] == 9
        covariance = read.fields["position_covariance"]
        known &= _placed(read)
        for k in np.flatnonzero(known):
            origin = _origin(np.radians(latitude[k]), np.radians(longitude[k]), float(height[k]))
            told = (*covariance[k][[0, 1, 4]].tolist(), 0.0) if certain[k] else UNTOLD
            self._track(key, origin).add(float(t[k]), *read.fields["p_ned_m"][k].tolist(), told)

    def _gnss(self, key: str, read: Samples, t: Array) -> None:
        fields = read.fields
        for k in np.flatnonzero(fields["quality"]):
            latitude, longitude, height = (float(fields[name][k]) for name in PLACE)
            place = (float(np.radians(latitude)), float(np.radians(longitude)), height)
            sigma, quality = UNTOLD[:3], float(fields["quality"][k])
            if read.lengths["position_sigma_ned_m"][k] == 3:
                north, east, _ = fields["position_sigma_ned_m"][k].tolist()
                sigma = (north**2, 0.0, east**2)
            self._track(key, _origin(*place)).add_place(float(t[k]), place, (*sigma, quality))

    def _track(self, key: str, origin: tuple[float, float, float]) -> TrackLine:
        return self._tracks.setdefault(key, TrackLine(key, origin))

    def _note(self, key: str, read: Samples, t: Array) -> None:
        fields = read.fields
        for k, at_utc_ns in enumerate(fields["at_utc_ns"].tolist()):
            moment = (at_utc_ns - self._extent.first_ns) / 1e9 if at_utc_ns else float(t[k])
            text, author = fields["text"][k] or "mark", fields["author"][k]
            self._marks.append(Mark(moment, text, author, float(fields["seconds"][k])))


def _means(binner: Binner, names: tuple[str, ...], n: int) -> Line:
    """The first n bins of readings, without the least and the greatest of each."""
    line = binner.line(n)
    return Line(line.key, line.mean, line.mean, line.mean, names)


def _sight(read: Samples) -> NDArray[np.uint8] | None:
    """What an estimator says of each component (n, 3); None where it never says it."""
    said = read.fields.get("sight")
    if said is None or said.shape[1] != 3:
        return None
    return np.where((read.lengths["sight"] == 3)[:, None], said, 0).astype(np.uint8)


def _origin(latitude: float, longitude: float, height: float) -> tuple[float, float, float]:
    """Where a track counts from, at height 0 where its first point has none."""
    return latitude, longitude, height if np.isfinite(height) else 0.0


def _placed(read: Samples) -> NDArray[np.bool_]:
    """Where a navigation filter has a place (n,): before its first fix old ones say 0 with a sigma
    of 10,000 km.
    """
    sigma = read.fields["sigma"]
    if sigma.shape[1] < 8:
        return np.ones(len(sigma), dtype=bool)
    return ~(np.hypot(sigma[:, 6], sigma[:, 7]) > NO_PLACE_M)


def _dark(key: str, lines: dict[str, Line]) -> NDArray[np.bool_] | None:
    """Bins in which the tachometer's device has no sample at all."""
    mine = [line.mean[:, 0] for line in lines.values() if line.device == key.split("/")[0]]
    return np.isnan(np.column_stack(mine)).all(axis=1) if mine else None


def leader_of(path: Path) -> str:
    """The first rate estimator of the configuration that a session was recorded with, else of the
    default one.
    """
    try:
        estimator = read_manifest(path.parent).configuration.get("estimator")
    except SessionError:
        estimator = None
    names = estimator.get("rate") if isinstance(estimator, dict) else None
    return str(names[0]) if names else LEADER


def _decoded(topic: Topic, block: Block) -> Iterator[tuple[int, Message]]:
    for log_ns, payload in zip(block.log_ns, block.payloads, strict=True):
        try:
            yield log_ns, decode(topic, payload)
        except DecodeError:
            continue


def main(arguments: list[str]) -> int:
    """The program; 0 when the curves are there, 1 with one line on standard error when not."""
    path = Path(arguments[0])
    try:
        if load(path) is None:
            save(build(path, on_progress=lambda done: print(f"{done:.3f}", flush=True)), path)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
