"""A procedure as people write it: a TOML file of steps and limits, and the plan that it comes to.

    title = "Rate steps"
    [[steps]]
    kind = "rate"
    rate_dps = 100
    dwell_s = 10
    tolerance_dps = 2
    [steps.limits.rate_error_dps]
    min = -1
    max = 1
    [limits.scale_factor_error_ppm]
    min = -5000
    max = 5000

Degrees and mg stand in the file, since people write it; the plan is in SI.
"""

import hashlib
import math
import re
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from inertial.constants import MILLI_G
from messages import text as texts
from sessions.report.limits import Limit

DEG = math.pi / 180.0
MOST = 512  # steps of a plan
FACES = {
    f"{'+' if sign > 0 else '-'}{'xyz'[k]}": tuple(sign * (j == k) for j in range(3))
    for k in range(3)
    for sign in (1.0, -1.0)
}
# Figures of a step, by its kind; those of the whole are in docs/procedures.md.
OF_STEP = {
    "rate": ("rate_error_dps", "rate_scatter_dps", "rate_rms_dps", "vibration_mg"),
    "still": ("rate_error_dps", "rate_scatter_dps", "rate_rms_dps", "vibration_mg"),
    "pose": ("force_error_mg", "vibration_mg"),
}
OF_WHOLE = (
    "completeness lost_samples bad_bytes rate_rms_x_dps rate_rms_y_dps rate_rms_z_dps"
    " scale_factor_error_ppm scale_factor_sigma_ppm linearity_ppm asymmetry_ppm hysteresis_ppm"
    " rate_bias_dps cross_axis_x_mrad cross_axis_y_mrad angle_error_deg nis_per_dof"
    " position_error_m equivalent_drift_dph accel_bias_x_mg accel_bias_y_mg accel_bias_z_mg"
).split()
OF_AXES = re.compile(r"[a-z]\d+_random_walk_mps_sqrt_s")


def _words(text: str) -> str:
    if fault := texts.check(text):
        raise ValueError(fault)
    return text


Words = Annotated[str, Field(max_length=200), AfterValidator(_words)]
Seconds = Annotated[float, Field(gt=0, le=1e6)]
Limits = dict[str, Limit]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _Step(_Part):
    name: Words = ""
    limits: Limits = {}

    @model_validator(mode="after")
    def _figures(self) -> "_Step":
        known = OF_STEP.get(_family(self.kind), ())  # type: ignore[attr-defined]
        for name in self.limits:
            if name not in known:
                there = ", ".join(known) or "none"
                raise ValueError(f"limits.{name}: no figure of such a step; there are {there}")
        return self


def _family(kind: str) -> str:
    return "rate" if kind == "staircase" else kind


class Still(_Step):
    """The table stands."""

    kind: Literal["still"]
    seconds: Seconds


class Rate(_Step):
    """The table turns at one rate."""

    kind: Literal["rate"]
    rate_dps: float = Field(ge=-1e4, le=1e4)  # positive: counter-clockwise seen from above
    dwell_s: Seconds
    ramp_s: Seconds = 1.0  # the table takes so long to get there
    tolerance_dps: float = Field(default=2.0, gt=0)


class Staircase(_Step):
    """Rates one after the other: up, and down again where that is wanted; expands to rates."""

    kind: Literal["staircase"]
    from_dps: float = Field(ge=-1e4, le=1e4)
    to_dps: float = Field(ge=-1e4, le=1e4)
    stairs: int = Field(ge=2, le=200)  # levels from first to last
    down_again: bool = True
    dwell_s: Seconds
    ramp_s: Seconds = 1.0
    tolerance_dps: float = Field(default=2.0, gt=0)

    def levels(self) -> list[float]:
        """Rates in order, deg/s."""
        height = (self.to_dps - self.from_dps) / (self.stairs - 1)
        up = [self.from_dps + k * height for k in range(self.stairs)]
        return up + (up[-2::-1] if self.down_again else [])


class Pose(_Step):
    """The body rests with one face up."""

    kind: Literal["pose"]
    up: Literal["+x", "-x", "+y", "-y", "+z", "-z"]
    seconds: Seconds = 5.0


class Open(_Step):
    """Something a person does and confirms, as a temperature; what is asked for goes into the
    report.
    """

    kind: Literal["open"]
    instruction: Words
    ask: Words = ""  # as "temperature in deg C"


class Record(_Step):
    """Recording begins or ends here; without such a step all of the run is recorded."""

    kind: Literal["record"]
    on: bool


AnyStep = Annotated[Still | Rate | Staircase | Pose | Open | Record, Field(discriminator="kind")]


class Procedure(_Part):
    """The whole file."""

    title: Words = Field(min_length=1)
    standard: Words = ""
    unit: Words = ""  # what is tested, in words; the serial number is asked for at the start
    text: str = Field(default="", max_length=2000)
    estimator: str = "products-ekf"  # whose figures are judged
    repeats: int = Field(default=2, ge=0, le=100)  # of a spoilt step, before a person is asked
    settle_s: float = Field(default=1.0, ge=0, le=600)  # within the tolerance before a dwell begins
    vibration_max_mg: float = Field(default=30.0, gt=0)  # RMS, with the noise of the sensors in it
    steps: list[AnyStep] = Field(min_length=1, max_length=MOST)
    limits: Limits = {}

    @model_validator(mode="after")
    def _sound(self) -> "Procedure":
        import difflib

        for name in self.limits:
            if name not in OF_WHOLE and not OF_AXES.fullmatch(name):
                near = difflib.get_close_matches(name, OF_WHOLE, 1)
                hint = f"; did you mean {near[0]}?" if near else ""
                raise ValueError(f"limits.{name}: no figure of a report{hint}")
        if fault := texts.check(self.text, lines=True):
            raise ValueError(f"text: {fault}")
        if len(plan_of(self)) > MOST:
            raise ValueError(f"{len(plan_of(self))} steps with all stairs; want at most {MOST}")
        return self


@dataclass(frozen=True)
class Step:
    """One step of the plan; SI, rates about z_b."""

    name: str
    kind: str  # still, rate, pose, open, record
    target: float = 0.0  # rad/s
    ramp_s: float = 0.0
    dwell_s: float = 0.0
    tolerance: float = 2.0 * DEG  # rad/s
    up_b: tuple[float, ...] = ()  # 3, the direction of b that should point up
    instruction: str = ""
    ask: str = ""
    on: bool = True
    limits: tuple[tuple[str, Limit], ...] = ()


@dataclass(frozen=True)
class Plan:
    """What a file comes to, and which file it was."""

    name: str
    toml: str
    procedure: Procedure
    steps: tuple[Step, ...]

    @property
    def sha256(self) -> str:
        """Of the file's text."""
        return hashlib.sha256(self.toml.encode()).hexdigest()

    @property
    def vibration_max(self) -> float:
        """m/s^2, RMS."""
        return self.procedure.vibration_max_mg * MILLI_G

    @property
    def least_seconds(self) -> float:
        """What ramps, settling and dwells take together, s; open steps and poses come to it."""
        settle = self.procedure.settle_s
        return sum(s.ramp_s + s.dwell_s + (settle if s.dwell_s else 0.0) for s in self.steps)


STILL_DPS = 1.0  # a table that turns slower stands


def plan_of(procedure: Procedure) -> tuple[Step, ...]:
    """The steps with every staircase expanded."""
    found: list[Step] = []
    for number, step in enumerate(procedure.steps, 1):
        limits = tuple(step.limits.items())
        where = step.name or f"step {number}"
        match step:
            case Still():
                name = step.name or "standstill"
                found.append(
                    Step(name, "still", 0.0, 0.0, step.seconds, STILL_DPS * DEG, limits=limits)
                )
            case Rate():
                found.append(_turn(step.name or f"{step.rate_dps:+g} °/s", step.rate_dps, step))
            case Staircase():
                for k, level in enumerate(step.levels(), 1):
                    where = f"{step.name[:150] or 'stair'} {k}: {level:+.4g} °/s"
                    found.append(_turn(where, level, step))
            case Pose():
                name = step.name or f"{step.up} up"
                up = FACES[step.up]
                dwell = step.seconds
                found.append(Step(name, "pose", dwell_s=dwell, up_b=up, limits=limits))
            case Open():
                found.append(Step(where, "open", instruction=step.instruction, ask=step.ask))
            case Record():
                name = step.name or f"recording {'on' if step.on else 'off'}"
                found.append(Step(name, "record", on=step.on))
    return tuple(found)


def _turn(name: str, rate_dps: float, step: Rate | Staircase) -> Step:
    """A rate, or a standstill where a stair is at zero."""
    still = abs(rate_dps) < 1e-9
    return Step(
        name,
        "still" if still else "rate",
        0.0 if still else rate_dps * DEG,
        step.ramp_s,
        step.dwell_s,
        (STILL_DPS if still else step.tolerance_dps) * DEG,
        limits=tuple(step.limits.items()),
    )
