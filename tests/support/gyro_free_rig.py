"""Messages of a cube with a receiver beside it, on a turning arm or in a car, as the gateway would
send them.
"""

import numpy as np

from inertial.layouts.catalogue import CUBE
from inertial.simulation.arm import arm_test, centre
from inertial.simulation.table import SensorModel
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ACCEL, GNSS
from support.cube_drive import cube_readings

LATITUDE, LONGITUDE, HEIGHT = 37.759, 45.978, 1468.0
METRES = 111_195.0  # per degree of latitude, of a sphere: 0.2 % of 3 m do not matter
COS = np.cos(np.radians(LATITUDE))
SETTINGS = {
    "rate": ["products-free"],
    "gyro_free_rate": "products-free",
    "gyro_free_navigation": ["huber"],
    "use_every_fix": 2,
}


def batches(t_s, readings, first_index, sequence, size=10):
    """One message for each `size` rows (n, 12) of m/s^2."""
    for k in range(0, len(readings), size):
        t = float(t_s[k])
        header = pb.Header(
            device="cube",
            sequence=sequence + k,
            epoch=1,
            device_us=round(t * 1e6),
            utc_ns=round((1e9 + t) * 1e9),
        )
        flat = readings[k : k + size].ravel().tolist()
        yield pb.AccelBatch(
            header=header, first_index=first_index + k, period_s=0.01, axes=12, f_mps2=flat
        )


def messages(seconds, half_side=0.05, seed=3, sensor=SensorModel()):
    """The arm: batches of its cube and a fix every 0.5 s, in the order of the bus."""
    test, draw, out = (
        arm_test(seed, half_side=half_side, sensor=sensor),
        np.random.default_rng(seed),
        [],
    )
    for number in range(int(np.ceil(seconds / 10.0))):
        block = test.block(number)
        for batch in batches(block.t_s, block.readings, block.index, block.index):
            out.append((ACCEL, batch))
            t = batch.header.device_us * 1e-6 + 0.1
            if round(t * 10) % 5 == 0:
                out.append((GNSS, fix(test, t, round(t * 2), draw)))
    return test, out


def car_messages(drive, half_side, sensor, seed):
    """A car: batches of the cube in it and its receiver's fixes, one a second."""
    t_s, out, fixes = drive.imu[:, 0], [], list(drive.fixes)
    readings = cube_readings(drive, CUBE(half_side), sensor, seed)
    for batch in batches(t_s, readings, 0, 0):
        out.append((ACCEL, batch))
        t = batch.header.device_us * 1e-6 + 0.09
        while fixes and fixes[0].arrival <= t:
            f = fixes.pop(0)
            header = pb.Header(
                device="cube", sequence=f.key + 1, epoch=1, device_us=round(f.arrival * 1e6)
            )
            out.append(
                (
                    GNSS,
                    pb.GnssFix(
                        header=header,
                        latitude_deg=np.degrees(f.latitude),
                        longitude_deg=np.degrees(f.longitude),
                        height_m=f.height,
                        quality=1,
                        device_time_s=f.t,
                        position_sigma_ned_m=f.sigma_p,
                        v_n_mps=f.v_n,
                        velocity_sigma_ned_mps=f.sigma_v,
                    ),
                )
            )
    return out


def fix(test, t, sequence, draw):
    p, v = centre(test, t)
    p, v = p + draw.normal(size=3) * 0.3, v + draw.normal(size=3) * 0.1
    header = pb.Header(device="cube", sequence=sequence, epoch=1, device_us=round(t * 1e6))
    return pb.GnssFix(
        header=header,
        latitude_deg=LATITUDE + p[0] / METRES,
        height_m=HEIGHT - p[2],
        longitude_deg=LONGITUDE + p[1] / (METRES * COS),
        quality=2,
        device_time_s=t,
        position_sigma_ned_m=[0.3] * 3,
        v_n_mps=v,
        velocity_sigma_ned_mps=[0.1] * 3,
    )


def heading_error(test, t, q_nb):
    angle = float(test.profile.motion(np.array([t]))[0][0])
    w, x, y, z = q_nb
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return (yaw + angle + np.pi) % (
        2 * np.pi
    ) - np.pi  # z_b is up: a positive angle is a turn to the left
