"""What the estimators of a device cost, measured while they run."""


class Cost:
    """Measured time per sample, by device, since it was last asked for."""

    def __init__(self) -> None:
        self._ns: dict[str, int] = {}
        self._samples: dict[str, int] = {}
        self._asked: dict[tuple[str, str], tuple[int, int]] = {}

    def add(self, device: str, ns: int, samples: int) -> None:
        self._ns[device] = self._ns.get(device, 0) + ns
        self._samples[device] = self._samples.get(device, 0) + samples

    def take(self, device: str, estimator: str) -> float:
        """us per sample of all estimators of this device together."""
        now = (self._ns.get(device, 0), self._samples.get(device, 0))
        before = self._asked.get((device, estimator), (0, 0))
        self._asked[device, estimator] = now
        return (now[0] - before[0]) / max(1, now[1] - before[1]) / 1000.0
