"""[estimator] of gyrofree.toml."""

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, field_validator

import inertial
from inertial.rate.names import USUAL

KINDS = sorted(file.stem for file in (Path(inertial.__file__).parent / "layouts").glob("*.toml"))
Metres = Annotated[float, Field(ge=-1000.0, le=1000.0)]


class LayoutSettings(BaseModel):
    """Where the accelerometers of one board sit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    # a file of inertial/layouts by name: cube, chen-6, nine, edges-12, stars-12, array-24
    kind: str = "cube"
    half_side_m: float = Field(default=0.05, gt=0.0, le=10.0)  # m, from the cube's centre to a face
    file: str = (
        ""  # the user's own layout instead, a TOML file (docs/layouts.md); its sizes are its own
    )

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in KINDS:
            raise ValueError(
                f"no layout {kind!r}, want one of {', '.join(KINDS)}; your own goes into file"
            )
        return kind


class VehicleSettings(BaseModel):
    """What a navigation filter must know of the vehicle a six-axis board rides in."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    lever_arm_b_m: tuple[Metres, Metres, Metres] = (
        0.0,
        0.0,
        0.0,
    )  # m, from IMU to antenna: forward, right, down
    # m/s, above which the course is taken as the heading; what never gets there is aligned by what
    # its accelerometers feel
    align_speed_mps: float = Field(default=4.0, ge=0.5, le=100.0)
    align_standstill_s: float = Field(default=10.0, ge=1.0, le=600.0)  # s of rest that level it


class EstimatorSettings(BaseModel):
    """[estimator]: which estimators run, and what they know of each device."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rate: list[str] = Field(default_factory=lambda: list(USUAL))  # gyro-free rate estimators
    navigators: list[str] = Field(
        default_factory=lambda: ["huber-nhc", "kf", "fpe-fuzzy"]
    )  # the first leads
    gyro_free_navigation: list[str] = Field(
        default_factory=list
    )  # filters on a cube's own rate, where it has GNSS
    gyro_free_rate: str = ""  # the rate estimator whose word they take; empty: the first of rate
    attitudes: list[str] = Field(
        default_factory=lambda: ["vqf", "tilt-vector", "tilt-published"]
    )  # tilt of six axes
    layout: LayoutSettings = LayoutSettings()  # of a device that layouts does not name
    layouts: dict[str, LayoutSettings] = Field(default_factory=dict)  # by device name
    tacho_aid: bool = (
        False  # correct the rate by the tachometer: then it cannot be scored against it any more
    )
    tacho_axis_b: tuple[float, float, float] = (
        0.0,
        0.0,
        1.0,
    )  # the axis in b that the tachometer's rate is about
    latitude_deg: float | None = Field(
        default=None, ge=-90.0, le=90.0
    )  # given: a standing body turns with the Earth
    calibration: Path | None = None  # calibration file of a device that calibrations does not name
    calibrations: dict[str, Path] = Field(default_factory=dict)  # calibration files by device name
    cards: Path = Path("var/cards")  # folder that a guided calibration saves its cards to
    axes: Path = Path("var/axes")  # folder that a guided detection saves its axis maps to
    axis_maps: dict[str, Path] = Field(default_factory=dict)  # axis maps in use, by device name
    vehicle: VehicleSettings = VehicleSettings()  # of a device that vehicles does not name
    vehicles: dict[str, VehicleSettings] = Field(default_factory=dict)  # by device name
    use_every_fix: int = Field(
        default=1, ge=1, le=1000
    )  # n: filters get one fix in n, the others only score them
    max_devices: int = Field(
        default=256, ge=1, le=4096
    )  # those that come first; messages of more are counted as refused
    journal: Path | None = (
        None  # folder: what is published, and the state to go on with after a crash
    )
    journal_bytes: int = Field(default=1 << 30, ge=1 << 20)  # bytes kept, the oldest go first ...
    journal_age_s: float = Field(default=7200.0, ge=60.0)  # ... and s
    rate_limit_hz: float = Field(
        default=200.0, gt=0.0, le=1000.0
    )  # Hz, at most, of each rate/<estimator>
    attitude_limit_hz: float = Field(
        default=50.0, gt=0.0, le=1000.0
    )  # Hz, at most, of each attitude/<estimator>
    nav_limit_hz: float = Field(default=20.0, gt=0.0, le=200.0)  # Hz, at most, of nav and pose

    @property
    def believed_rate(self) -> str:
        """The rate estimator that feeds gyro-free navigation."""
        return self.gyro_free_rate or (self.rate or [""])[0]

    def layout_of(self, device: str) -> LayoutSettings:
        """Accelerometer layout of a device."""
        return self.layouts.get(device, self.layout)

    def card_of(self, device: str) -> Path | None:
        """Calibration file of a device."""
        return self.calibrations.get(device, self.calibration)

    def vehicle_of(self, device: str) -> VehicleSettings:
        """Vehicle of a device."""
        return self.vehicles.get(device, self.vehicle)
