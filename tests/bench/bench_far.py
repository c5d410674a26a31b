"""An office that watches a lab over a bad link: what crosses it, how old the picture is, how long
until it is back after a cut, until the overview of the cut is there, until a recording is
copied, and until all is stopped.

Real processes: `gyrofree up` at the lab with a simulated board, router and `site serve` at the
office, and the page's own feed (tests/support/far_watch.py); two network namespaces and an emulated
link between them. Both places have this machine's clock, so ages are true.

Usage: python tests/bench/bench_far.py [--json] [--congestion cubic|bbr] [--syn-retries 2]
       [--zenohd PROGRAM, which routes at both places in place of our router]
       [--cuts 5,30,120] [--rate 1e6] [--delay 0.1] [--loss 0.05] [--seconds 60] [--copy 9000000]
       [--copies 1] [--board-rate 100] [--record 0] [--stops]

--board-rate: samples a second of the board. --record: so many seconds of it are recorded, and
copied while they are. --stops: measure instead how long `gyrofree up` of both places takes to end,
a recording being copied, while the link is bad and while it is cut.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402
from support.far_link import Line, NoNamespaces  # noqa: E402
from support.far_site import FarSite, Watcher, far_site, until  # noqa: E402

PATIENCE_S = 180.0
SHARE = 1448 / 1500  # of a packet that is no header of IP and TCP
COARSE = 60  # moments of an overview
SERVICES = (("router",), ("site", "serve"))
LAB = ("up", "--without", "dashboard")  # its own page is another matter


def main() -> None:
    arguments = parsed()
    line = Line(arguments.rate, arguments.delay, arguments.loss)
    with tempfile.TemporaryDirectory() as folder:
        found = (stops if arguments.stops else watched)(arguments, Path(folder), line)
    about = {"bench": "far", "congestion": arguments.congestion, "rate": line.rate}
    about |= {"router": "zenohd" if arguments.zenohd else "gyrofree"}
    about |= {"delay_s": line.delay_s, "loss": line.loss, "board_hz": arguments.board_rate}
    if arguments.json:
        print(json.dumps(about | found))
        return
    print(", ".join(f"{name} {value}" for name, value in about.items()))
    for name, value in found.items():
        print(f"{name:32} {value:10.2f}")


def begun(arguments: argparse.Namespace, folder: Path, line: Line, **options):
    """The two places."""
    return far_site(
        folder,
        line,
        congestion=arguments.congestion,
        syn_retries=arguments.syn_retries,
        board=("--rate", str(arguments.board_rate)),
        zenohd=arguments.zenohd,
        **options,
    )


def watched(arguments: argparse.Namespace, folder: Path, line: Line) -> dict[str, float]:
    """An office that looks at the lab."""
    with begun(arguments, folder, line, lab=LAB, services=SERVICES) as site:
        watcher = Watcher(site)
        found = {"first_picture_s": until(lambda: watcher.lines, PATIENCE_S, "a picture")}
        time.sleep(20.0)  # estimators begin, the rate is found
        found |= live(site, watcher, arguments.seconds) if arguments.seconds else {}
        for seconds in arguments.cuts:
            found |= cut(site, watcher, seconds)
        for number in range(arguments.copies if arguments.copy else 0):
            found |= copied(site, watcher, arguments.copy, number)
        if arguments.record:
            found |= recorded(site, watcher, arguments.record)
        found["counted_as_lost"] = watcher.lines[-1]["lost"]
    return found


def stops(arguments: argparse.Namespace, folder: Path, line: Line) -> dict[str, float]:
    """From SIGTERM to the end of all processes, by place and link."""
    found = {}
    for link in ("bad", "cut"):
        with begun(arguments, folder / link, line, services=(("up",),)) as site:
            until(lambda: _says(site.lab) and _says(site.office), PATIENCE_S, "both places up")
            put(site, arguments.copy or 9_000_000, 0)
            time.sleep(15.0)
            if link == "cut":
                site.link.cut()
                time.sleep(2.0)
            ups = [one for one in site.processes if "up" in one.args]
            begin, ended = time.monotonic(), {}
            for one in ups:
                os.kill(one.pid, signal.SIGTERM)
            while len(ended) < len(ups) and time.monotonic() < begin + 60.0:
                now = time.monotonic() - begin
                ended |= {k: now for k, one in enumerate(ups) if k not in ended and not alive(one)}
                time.sleep(0.02)
            for place, k in (("lab", 0), ("office", 1)):
                found[f"stop_{link}_{place}_s"] = ended.get(k, float("nan"))
    return found


def _says(folder: Path) -> bool:
    """Is the page of a place there?"""
    log = folder / "up.log"
    return log.exists() and "dashboard at" in log.read_text()


def alive(one: subprocess.Popen) -> bool:
    return one.poll() is None


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--congestion", default="cubic")
    parser.add_argument(
        "--cuts", default="5,30,120", type=lambda s: [float(x) for x in s.split(",") if x]
    )
    parser.add_argument("--syn-retries", type=int, default=2)
    parser.add_argument("--zenohd", type=Path)
    parser.add_argument("--rate", type=float, default=1e6)
    parser.add_argument("--delay", type=float, default=0.1)
    parser.add_argument("--loss", type=float, default=0.05)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--copy", type=int, default=9_000_000)
    parser.add_argument("--copies", type=int, default=1)
    parser.add_argument("--board-rate", type=float, default=100.0)
    parser.add_argument("--record", type=float, default=0.0)
    parser.add_argument("--stops", action="store_true")
    return parser.parse_args()


def live(site: FarSite, watcher: Watcher, seconds: float) -> dict[str, float]:
    """Bits a second, and the age of the newest sample."""
    before, back = site.link.there.carried_bytes, site.link.back.carried_bytes
    first = len(watcher.lines)
    time.sleep(seconds)
    there = site.link.there.carried_bytes - before
    return {
        "live_kbitps": 8e-3 * there / seconds,
        "live_back_kbitps": 8e-3 * (site.link.back.carried_bytes - back) / seconds,
        **ages(watcher, first, "age"),
        "rate_hz": float(np.median([one["rate"] for one in watcher.lines[first:]])),
    }


def ages(watcher: Watcher, first: int, name: str) -> dict[str, float]:
    found = [one["at"] - one["newest"] for one in watcher.lines[first:]]
    return {
        f"{name}_p50_s": float(np.median(found)),
        f"{name}_p99_s": float(np.quantile(found, 0.99)),
    }


def cut(site: FarSite, watcher: Watcher, seconds: float) -> dict[str, float]:
    """From the moment the link is whole again."""
    begin = watcher.newest
    site.link.cut()
    time.sleep(seconds)
    site.link.mend()
    mended = time.time()
    back = until(lambda: watcher.newest > mended, PATIENCE_S, "the picture after a cut")
    print(f"after {seconds:g} s: {back:.1f} s", file=sys.stderr)
    pause = 2.5 * max(1.0, (mended - begin) / COARSE)

    def covered() -> bool:
        rows = np.array([row for row in watcher.rows if begin - 2.0 <= row <= mended + 1.0])
        edges = np.concatenate([[begin], rows, [mended]])
        return bool(np.diff(np.sort(edges)).max() <= pause)

    try:
        until(covered, PATIENCE_S, "the overview of a cut")
        overview = time.time() - mended
    except TimeoutError:
        overview = float("nan")
    time.sleep(15.0)  # a lease that ends late must not count for the next cut
    name = f"after_{seconds:g}_s_cut"
    return {f"{name}_picture_s": back, f"{name}_overview_s": overview}


def put(site: FarSite, size: int, number: int) -> Path:
    """A recording of so many bytes at the lab: what ends its copy at the office."""
    session = f"20261129-12{number:02}00-copied"
    folder = site.lab / "var/sessions" / session
    folder.mkdir(parents=True)
    (folder / "recording.mcap").write_bytes(random.Random(1 + number).randbytes(size))
    (folder / "session.json").write_text(json.dumps({"id": session, "state": "closed"}))
    return site.office / "var/sessions" / session / "session.json"


def copied(site: FarSite, watcher: Watcher, size: int, number: int) -> dict[str, float]:
    """A recording of so many bytes, while the picture goes on."""
    first = len(watcher.lines)
    there = put(site, size, number)
    seconds = until(there.exists, 20 * PATIENCE_S, "the copy")
    return {
        f"{name}{_nth(number)}": value for name, value in _over(site, size, seconds).items()
    } | {
        **ages(watcher, first, f"age_while_copying{_nth(number)}"),
    }


def _nth(number: int) -> str:
    return f"_{number + 1}" if number else ""


def _over(site: FarSite, size: int, seconds: float) -> dict[str, float]:
    """What the link allows for so many bytes, and how much longer it took."""
    line = site.link.line
    allowed = 8 * size / (line.rate * (1.0 - line.loss) * SHARE)
    return {"copy_s": seconds, "copy_allowed_s": allowed, "copy_over_allowed": seconds / allowed}


def recorded(site: FarSite, watcher: Watcher, seconds: float) -> dict[str, float]:
    """The board is recorded, and copied while it is; how long after its end the copy is equal."""
    first = len(watcher.lines)
    site.order("start", "long")
    time.sleep(seconds)
    site.order("stop")
    sessions = [e for e in (site.lab / "var/sessions").iterdir() if e.name.endswith("long")]
    size = sum(path.stat().st_size for path in sessions[0].iterdir() if path.is_file())
    there = site.office / "var/sessions" / sessions[0].name / "session.json"
    after = until(there.exists, 20 * PATIENCE_S, "the copy of what was recorded")
    found = {"recorded_s": seconds, "recorded_mb": 1e-6 * size, "equal_after_its_end_s": after}
    return found | ages(watcher, first, "age_while_recording")


if __name__ == "__main__":
    try:
        main()
    except NoNamespaces as error:
        raise SystemExit(f"bench_far: no network namespaces here: {error}") from None
