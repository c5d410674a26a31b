"""Read live values of a board from a running dashboard, by REST and as a stream.

Shown: a program with an API token asks for the newest rate once, then listens to server-sent events
of rate and attitude. What is not known comes as null and stays unknown. Make the token first:

    gyrofree users token create NAME --name "trying it"
    python examples/live_values.py http://localhost:8080 TOKEN cube

Without arguments nothing is asked: the reader shows what it makes of three events.
"""

import json
import math
import sys
from collections.abc import Iterable, Iterator

import httpx

SAMPLE = (
    "event: rate",
    'data: {"utc_s": 1.0, "omega_radps": [0.0, null, 2.0], "sight": ["valid", "blind", "valid"]}',
    "",
    ": nothing new",
    "",
    "event: end",
    'data: {"why": "revoked"}',
)


def events(lines: Iterable[str]) -> Iterator[tuple[str, dict]]:
    """Name and content of server-sent events."""
    name = ""
    for line in lines:
        if line.startswith("event: "):
            name = line.removeprefix("event: ")
        elif line.startswith("data: "):
            yield name, json.loads(line.removeprefix("data: "))


def degrees(values: list[float | None]) -> str:
    """Rates in deg/s; a dash is not known."""
    return " ".join("-" if value is None else f"{math.degrees(value):.2f}" for value in values)


def show(name: str, said: dict) -> None:
    """One event as a line."""
    if name == "rate":
        print(f"{said['utc_s']:.2f} s: {degrees(said['omega_radps'])} deg/s, {said['sight']}")
    elif name == "attitude":
        print(f"{said['utc_s']:.2f} s: q_nb {said['q_nb']}")
    elif name == "end":
        print(f"the stream ended: {said['why']}")


def main(url: str = "", token: str = "", device: str = "cube", most: int = 100) -> None:
    """Ask once, then listen to `most` events."""
    if not url:
        for name, said in events(SAMPLE):
            show(name, said)
        return
    headers = {"authorization": f"Bearer {token}"}
    with httpx.Client(base_url=url, headers=headers, timeout=30.0) as client:
        now = client.get(f"/api/devices/{device}/rate").raise_for_status().json()
        print(f"by {now['estimator']}, {'stale' if now['stale'] else 'live'}")
        show("rate", now)
        where = f"/api/devices/{device}/stream"
        with client.stream("GET", where, params={"topics": "rate,attitude"}) as answer:
            for _, (name, said) in zip(range(most), events(answer.iter_lines()), strict=False):
                show(name, said)


if __name__ == "__main__":
    main(*sys.argv[1:4])
