"""Plausible messages of a cube on a table and of a car, deterministic, over a real Zenoh router in
this process.

For tests and for looking at the dashboard without the rest of the system:

    python tests/feeder.py cube|drive|both [viser port]
"""

import math
import sys
import threading
import time

import numpy as np

from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract import rates
from messages.contract import topics as tp

UTC0_NS = 1_750_000_000_000_000_000
DEG = math.pi / 180
TILT = 2 * DEG
ORIGIN = (40.0966268, -105.1474483, 1601.47)
TRIAD_AXES = np.array(
    [[[0, 1, 0], [-1, 0, 0], [0, 0, 1]], [[0, -1, 0], [1, 0, 0], [0, 0, 1]]]
    + [[[0, 1, 0], [1, 0, 0], [0, 0, -1]], [[0, -1, 0], [-1, 0, 0], [0, 0, -1]]],
    dtype=float,
)


def table_rate(t: float) -> float:
    """Rate of the table at time t (s) of a 30 s profile: still, 171 deg/s, still, -171 deg/s;
    rad/s.
    """
    t = t % 30.0
    for begin, end, size in ((5.0, 13.5, 171.0), (16.5, 25.0, -171.0)):
        if begin <= t <= end:
            ramp = min((t - begin) / 0.6, (end - t) / 0.6, 1.0)
            return size * DEG * ramp * ramp * (3 - 2 * ramp)
    return 0.0


def multiply(a, b) -> list[float]:
    """Product of two quaternions w, x, y, z."""
    w, x, y, z = a
    e, f, g, h = b
    return [
        w * e - x * f - y * g - z * h,
        w * f + x * e + y * h - z * g,
        w * g - x * h + y * e + z * f,
        w * h + x * g - y * f + z * e,
    ]


def cube_attitude(angle: float) -> list[float]:
    """q_nb of a cube whose z_b points up on a tilted table, turned by `angle` (rad)."""
    flip = [0.0, 1.0, 0.0, 0.0]  # z_b up in north-east-down
    tilt = [math.cos(TILT / 2), math.sin(TILT / 2), 0.0, 0.0]
    turn = [math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)]
    return multiply(multiply(flip, tilt), turn)


class Feeder:
    """Publishes one step after the other; times are given, so that the content does not depend on
    the clock.
    """

    def __init__(self, publishers: Publishers, utc0_ns: int = UTC0_NS, seed: int = 1) -> None:
        self._put, self._utc0 = publishers.put, utc0_ns
        self._random = np.random.default_rng(seed)
        self._angle = 0.0
        self._drift = 0.0
        self._k = 0

    def _header(self, device: str, t: float, source: int) -> pb.Header:
        return pb.Header(
            device=device, epoch=1, utc_ns=self._utc0 + int(t * 1e9), source=source, run=7
        )

    def cube(self, t: float, dt: float = 0.01, device: str = "cube-01") -> None:
        """One sample of the cube at time t (s), dt after the one before."""
        self._k += 1
        noise = self._random.normal
        omega = table_rate(t)
        self._angle += omega * dt
        self._drift += (0.9 * DEG * (1 + abs(omega))) * dt
        q = cube_attitude(self._angle)
        f_b = np.array(
            [
                9.8 * math.sin(TILT) * math.sin(self._angle),
                -9.8 * math.sin(TILT) * math.cos(self._angle),
                9.79,
            ]
        )
        counts = np.round((TRIAD_AXES @ f_b).ravel() / 0.03825 + noise(0, 1, 12)).astype(int)
        header = self._header(device, t, pb.SOURCE_SIMULATED)
        accel = pb.AccelBatch(
            header=header,
            first_index=self._k,
            period_s=dt,
            axes=12,
            counts=counts,
            f_mps2=counts * 0.03825,
        )
        self._put(tp.ACCEL, device, accel)
        truth = pb.Truth(
            header=header, for_index=self._k, q_nb=q, f_b_mps2=f_b, angle_z_rad=self._angle
        )
        truth.omega_ib_b_radps.extend([0, 0, omega])
        self._put(tp.TRUTH, device, truth)
        self._estimates(device, header, omega, f_b, noise)
        if self._k % 5 == 0 and omega:
            tacho = pb.TachoRate(
                header=header,
                omega_radps=omega + noise(0, 0.01),
                sigma_radps=0.01,
                direction_known=True,
            )
            self._put(tp.TACHO, device, tacho)
        if self._k % 100 == 1:
            self._health(device, header, ("products-ekf", "least-squares"), 100.0)

    def _estimates(
        self, device: str, header: pb.Header, omega: float, f_b: np.ndarray, noise
    ) -> None:
        fusing = abs(omega) > 20 * DEG
        for name, bias, sigma in (
            ("products-ekf", 0.0, 1.5 * DEG),
            ("least-squares", self._drift, 1.0 * DEG),
        ):
            estimate = pb.RateBatch(
                header=header, estimator=name, for_index=self._k, f_b_mps2=f_b + noise(0, 0.02, 3)
            )
            estimate.omega_ib_b_radps.extend(noise(0, 0.5 * DEG, 3) + [0.3 * bias, 0, omega + bias])
            spread = sigma + (0.3 * bias if name == "least-squares" else 0)
            estimate.omega_covariance.extend((np.eye(3) * spread**2).ravel())
            angle = self._angle + (2 * DEG if name == "products-ekf" else 3.0 * bias)
            estimate.angle_z_rad.append(angle)
            estimate.q_nb.extend(cube_attitude(angle))
            estimate.p_n_m.extend(
                [0.02 * bias * self._k**1.2, 0.01 * self._k**1.1, -0.001 * self._k]
            )
            estimate.still.append(not fusing)
            if name == "products-ekf" and fusing:
                estimate.innovation.extend(noise(0, 0.4, 6))
                estimate.innovation_sigma.extend([0.4] * 6)
                estimate.nis.append(self._random.chisquare(6))
                estimate.nis_dof.append(6)
                estimate.innovation_unit = "rad²/s²"
            self._put(tp.RATE, device, rates.complete(estimate), name)

    def _health(
        self, device: str, header: pb.Header, estimators: tuple[str, ...], rate: float
    ) -> None:
        link = pb.LinkStatus(
            header=header,
            connected=True,
            port="/dev/pts/7",
            bytes_in=self._k * 48 + 31,
            good_frames=self._k,
        )
        link.good_bytes, link.sample_rate_hz, link.frame_rate_hz = self._k * 48, rate, rate
        link.latency_p50_s, link.latency_p99_s, link.clock_skew_ppm = 0.0006, 0.0019, 18.3
        link.clock_residual_s, link.clock_window_s, link.bad_chunks, link.bad_bytes = (
            0.000085,
            60,
            2,
            31,
        )
        link.damage.update({"checksum": 1, "length": 1})
        link.journal_sequence, link.durable_sequence, link.lost_frames, link.lost_samples = (
            self._k + 3,
            self._k,
            1,
            1,
        )
        self._put(tp.LINK, device, link)
        board = pb.BoardInfo(
            header=header, board_id=1, firmware="1.0.0 (abc1234)", axes=12, sample_period_s=0.01
        )
        self._put(tp.BOARD, device, board)
        for name in estimators:
            status = pb.EstimatorStatus(
                header=header, estimator=name, samples=self._k, us_per_sample=41, state="running"
            )
            if name == "ekf":
                status.state = "navigating"
                status.message = f"fixes used {self._k // 5}, fixes rejected {self._k // 100}"
            self._put(tp.ESTIMATOR, device, status, name)

    def recorder(self, t: float) -> None:
        """The recorder's state, 1 Hz."""
        status = pb.RecorderStatus(
            header=self._header("recorder", t, 0), session="2026-01-01T10-00-00-demo"
        )
        self._put(tp.STATUS, tp.RECORDER, status)

    def drive(self, t: float, device: str = "car-01") -> None:
        """One 20 Hz step of a car on a winding loop at time t (s)."""
        self._k += 1
        noise = self._random.normal
        header = self._header(device, t, pb.SOURCE_PLAYED)
        phase = t / 40 * 2 * math.pi
        p = np.array(
            [
                180 * math.sin(phase),
                120 * (1 - math.cos(phase)) + 25 * math.sin(3 * phase),
                -4 * math.sin(phase),
            ]
        )
        v = np.array(
            [
                180 * math.cos(phase),
                120 * math.sin(phase) + 75 * math.cos(3 * phase),
                -4 * math.cos(phase),
            ]
        )
        v *= 2 * math.pi / 40
        yaw = math.atan2(v[1], v[0])
        imu = pb.ImuBatch(header=header, first_index=5 * self._k, period_s=0.01)
        imu.f_b_mps2.extend((noise(0, 0.3, (5, 3)) + [0, 0, -9.8]).ravel())
        imu.omega_ib_b_radps.extend((noise(0, 0.02, (5, 3)) + [0, 0, 0.2 * math.sin(t)]).ravel())
        self._put(tp.IMU, device, imu)
        nav = pb.NavSolution(header=header, estimator="ekf", mode=pb.NavSolution.MODE_NAVIGATING)
        nav.origin_latitude_deg, nav.origin_longitude_deg, nav.origin_height_m = ORIGIN
        nav.latitude_deg, nav.longitude_deg = _geodetic(p)
        nav.height_m = ORIGIN[2] - p[2]
        nav.p_ned_m.extend(p + noise(0, 0.05, 3))
        nav.v_n_mps.extend(v)
        nav.q_nb.extend([math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)])
        nav.sigma.extend([0.002, 0.002, 0.01, 0.05, 0.05, 0.08, 0.4, 0.5, 0.9] + [0.01] * 6)
        nav.position_covariance.extend(np.diag([0.16, 0.25, 0.81]).ravel())
        nav.fix_age_s = (self._k % 5) * 0.05
        self._put(tp.NAV, device, nav, "ekf")
        if self._k % 5 == 0:
            wild = self._k % 100 == 50  # a fix far off, which the filter rejects
            self._fix(
                device, header, p + noise(0, [0.4, 0.4, 0.8]) + (12.0 if wild else 0.0), v, not wild
            )
        if self._k % 20 == 1:
            self._health(device, header, ("ekf",), 100.0)

    def _fix(
        self, device: str, header: pb.Header, p: np.ndarray, v: np.ndarray, good: bool
    ) -> None:
        latitude, longitude = _geodetic(p)
        fix = pb.GnssFix(
            header=header, fix_utc_ns=header.utc_ns, latitude_deg=latitude, longitude_deg=longitude
        )
        fix.height_m, fix.quality, fix.satellites, fix.talker = (
            ORIGIN[2] - p[2],
            pb.GnssFix.QUALITY_RTK_FIXED,
            14,
            "UBX",
        )
        fix.v_n_mps.extend(v)
        fix.header.sequence = self._k
        self._put(tp.GNSS, device, fix)
        sky = pb.Sky(header=header, talker="UBX")
        for number in range(1, 13):
            sky.satellites.add(
                name=f"G{number:02d}",
                constellation=pb.Sky.CONSTELLATION_GPS,
                number=number,
                elevation_deg=7.0 * number,
                azimuth_deg=(77.0 * number) % 360,
                cn0_dbhz=20.0 + 2.5 * number if number > 1 else math.nan,
                use=pb.Sky.USE_YES if number > 2 else pb.Sky.USE_NO,
            )
        self._put(tp.SKY, device, sky)
        nis = self._random.chisquare(6) * (1 if good else 30)
        correction = pb.Innovation(
            header=header, estimator="ekf", nis=nis, dof=6, accepted=good, for_sequence=self._k
        )
        correction.name.extend([f"position {a}" for a in "NED"] + [f"velocity {a}" for a in "NED"])
        correction.value.extend(self._random.normal(0, 0.4, 6))
        correction.sigma.extend([0.4] * 6)
        self._put(tp.INNOVATION, device, correction, "ekf")


def _geodetic(p: np.ndarray) -> tuple[float, float]:
    north, east = 6362000.0 + ORIGIN[2], (6387000.0 + ORIGIN[2]) * math.cos(ORIGIN[0] * DEG)
    return ORIGIN[0] + p[0] / north / DEG, ORIGIN[1] + p[1] / east / DEG


def run(bus: BusSettings, kinds: tuple[str, ...], stop: threading.Event) -> None:
    """Feed in real time until told to stop."""
    session = open_client(bus, timeout_s=10)
    feeders = {kind: Feeder(Publishers(session, bus.prefix), time.time_ns()) for kind in kinds}
    began, k = time.monotonic(), 0
    while not stop.is_set():
        k += 1
        t = k * 0.01
        if "cube" in kinds and not 8.0 < t % 60 < 9.5:  # a pause that must be seen as a gap
            feeders["cube"].cube(t)
        if "drive" in kinds and k % 5 == 0:
            feeders["drive"].drive(t)
        if k % 100 == 0:
            feeders[kinds[0]].recorder(t)
        time.sleep(max(0.0, began + t - time.monotonic()))
    session.close()


def main() -> None:
    """Router, feeder and scene in one process, for looking."""
    from types import SimpleNamespace

    from dashboard.data.feed import Feed
    from dashboard.data.store import Store
    from dashboard.desk import Desk
    from dashboard.scene.service import start

    what = sys.argv[1] if len(sys.argv) > 1 else "both"
    port = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    endpoint = f"tcp/127.0.0.1:{17447 + port % 1000}"
    bus = BusSettings(router=endpoint, listen=[endpoint])
    with open_router(bus), open_client(bus, timeout_s=10) as session:
        store, watched = Store(), threading.Event()
        feed = Feed(session, bus.prefix, store, watched)
        handle = start(SimpleNamespace(viser_port=port), store, Desk(session, bus.prefix), watched)
        print(f"http://127.0.0.1:{handle.port}", file=sys.stderr, flush=True)
        try:
            run(bus, ("cube", "drive") if what == "both" else (what,), threading.Event())
        except KeyboardInterrupt:
            handle.stop()
            feed.stop()


if __name__ == "__main__":
    main()
