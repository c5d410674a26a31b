"""[estimator] of gyrofree.toml."""

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, field_validator

import inertial
from inertial.rate.names import USUAL
from messages.setting import setting

KINDS = sorted(file.stem for file in (Path(inertial.__file__).parent / "layouts").glob("*.toml"))
Metres = Annotated[float, Field(ge=-1000.0, le=1000.0)]


class LayoutSettings(BaseModel):
    """Where the accelerometers of one board sit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: str = setting(
        "cube",
        f"a layout by name: {', '.join(KINDS)} (docs/layouts.md)",
        shown=True,
    )
    half_side_m: float = setting(
        0.05,
        "from the cube's centre to a face, on which the accelerometers sit",
        unit="m",
        shown=True,
        gt=0.0,
        le=10.0,
    )
    file: str = setting(
        "", "your own layout instead, a TOML file (docs/layouts.md); its sizes are its own"
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

    lever_arm_b_m: tuple[Metres, Metres, Metres] = setting(
        (0.0, 0.0, 0.0), "from IMU to antenna: forward, right, down", unit="m"
    )
    align_speed_mps: float = setting(
        4.0,
        "above it the course is the heading; slower vehicles are aligned by what they feel",
        unit="m/s",
        ge=0.5,
        le=100.0,
    )
    align_standstill_s: float = setting(
        10.0, "rest that levels the unit", unit="s", ge=1.0, le=600.0
    )


class EstimatorSettings(BaseModel):
    """[estimator]: which estimators run, and what they know of each device."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rate: list[str] = setting(
        list(USUAL), "gyro-free rate estimators; the first is the first to be published", shown=True
    )
    navigators: list[str] = setting(
        ["huber-nhc", "kf", "fpe-fuzzy"],
        "of boards with gyroscopes; the first leads (docs/navigation.md compares them)",
        shown=True,
    )
    gyro_free_navigation: list[str] = setting(
        [], "filters on a cube's own rate, where it has GNSS (docs/gyro-free-navigation.md)"
    )
    gyro_free_rate: str = setting("", "rate estimator whose word they take; empty: first of `rate`")
    attitudes: list[str] = setting(
        ["vqf", "tilt-vector", "tilt-published"], "tilt filters of boards with gyroscopes"
    )
    layout: LayoutSettings = setting(
        LayoutSettings(), "accelerometers of a device that `layouts` does not name"
    )
    layouts: dict[str, LayoutSettings] = setting({}, "layouts by device name")
    tacho_aid: bool = setting(
        False,
        "correct the rate by the tachometer: then it cannot be scored against it any more",
    )
    tacho_axis_b: tuple[float, float, float] = setting(
        (0.0, 0.0, 1.0), "axis in the body's frame that the tachometer's rate is about"
    )
    latitude_deg: float | None = setting(
        None, "given: a standing body turns with the Earth", unit="deg", ge=-90.0, le=90.0
    )
    calibration: Path | None = setting(
        None, "calibration file of a device that `calibrations` does not name"
    )
    calibrations: dict[str, Path] = setting({}, "calibration files by device name")
    cards: Path = setting(
        Path("var/cards"), "folder that a guided calibration saves its calibration files to"
    )
    axes: Path = setting(Path("var/axes"), "folder that a guided detection saves its axis maps to")
    axis_maps: dict[str, Path] = setting({}, "axis maps in use, by device name")
    vehicle: VehicleSettings = setting(
        VehicleSettings(), "vehicle of a device that `vehicles` does not name"
    )
    vehicles: dict[str, VehicleSettings] = setting({}, "vehicles by device name")
    use_every_fix: int = setting(
        1, "n: filters get one fix in n, the others only score them", ge=1, le=1000
    )
    max_devices: int = setting(
        256, "those that come first; messages of more are counted as refused", ge=1, le=4096
    )
    journal: Path | None = setting(
        Path("var/estimates"),
        "folder: what is published, for who misses some, and the state to go on with after a"
        ' crash; "" keeps neither',
        shown=True,
    )
    journal_bytes: int = setting(
        1 << 30, "kept there, the oldest go first", unit="bytes", ge=1 << 20
    )
    journal_age_s: float = setting(
        7200.0, "what is published is kept there no longer", unit="s", ge=60.0
    )
    rate_limit_hz: float = setting(
        200.0, "at most, of each rate/<estimator>", unit="Hz", gt=0.0, le=1000.0
    )
    attitude_limit_hz: float = setting(
        50.0, "at most, of each attitude/<estimator>", unit="Hz", gt=0.0, le=1000.0
    )
    nav_limit_hz: float = setting(20.0, "at most, of nav and pose", unit="Hz", gt=0.0, le=200.0)

    @field_validator("journal", mode="before")
    @classmethod
    def _none(cls, value: object) -> object:
        return None if value == "" else value

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
