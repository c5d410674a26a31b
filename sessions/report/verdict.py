"""Pass or fail: a report's figures against limits in a TOML file.

title = "Acceptance on the rate table"
estimator = "products-ekf"            # whose figures are judged
[limits.rate_rms_z_dps]               # a name of docs/reports.md
max = 1.4
[limits.scale_factor_error_ppm]
min = -5000
max = 5000
"""

import difflib
import tomllib
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from inertial.toml_file import parsed, text_of
from sessions.report.limits import Limit
from sessions.report.metrics import Metric

DEFAULT = Path(__file__).parent / "acceptance.toml"


class SpecError(ValueError):
    """A specification that cannot be used; the text says where and why."""


class Spec(BaseModel):
    """A specification."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str = "Acceptance"
    estimator: str = "products-ekf"
    limits: dict[str, Limit] = {}


@dataclass(frozen=True)
class Check:
    """One limit, judged."""

    name: str
    value: float | None
    minimum: float | None
    maximum: float | None
    text: str = ""  # what the figure is
    sigma: float | None = None  # standard error of the value, where it is known

    @property
    def passed(self) -> bool | None:
        """None: this session cannot tell."""
        if self.minimum is None and self.maximum is None:
            return None
        return Limit(min=self.minimum, max=self.maximum).passed(self.value)


def load_spec(path: Path | None) -> Spec:
    """The file, or the one that comes with gyrofree; raises SpecError."""
    path = path or DEFAULT
    try:
        return Spec.model_validate(parsed(text_of(path)))
    except OSError as error:
        raise SpecError(f"{path}: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise SpecError(f"{path}: not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        raise SpecError(
            f"{path}: {'.'.join(map(str, first['loc'])) or 'the file'}: {first['msg']}"
        ) from None


def judge(spec: Spec, found: list[Metric]) -> list[Check]:
    """Every limit against its figure; raises SpecError for a limit on a figure that no report
    has.
    """
    values = {metric.name: metric.value for metric in found}
    texts = {metric.name: metric.text for metric in found}
    checks = []
    for name, limit in spec.limits.items():
        if name not in values and not _of_another_kind(name):
            near = difflib.get_close_matches(name, values, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise SpecError(f"limits.{name}: no such figure in this report{hint}")
        checks.append(Check(name, values.get(name), limit.min, limit.max, texts.get(name, "")))
    return checks


SOMETIMES = (
    "rate_",
    "scale_",
    "linearity",
    "asymmetry",
    "cross_",
    "angle_",
    "position_",
    "equivalent_",
    "nis_",
)


def _of_another_kind(name: str) -> bool:
    """Figures that only some sessions have: without them a limit is "not told", no mistake."""
    return name.startswith(SOMETIMES)


def overall(checks: list[Check]) -> str:
    """pass, fail, or incomplete when nothing failed but something could not be told."""
    if any(check.passed is False for check in checks):
        return "fail"
    return "pass" if checks and all(check.passed for check in checks) else "incomplete"
