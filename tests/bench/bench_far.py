"""An office that watches a lab over a bad link: what crosses it, how old the picture is, how long
until it is back after a cut, until the overview of the cut is there, and until a recording is
copied.

Real processes: `gyrofree up` at the lab with a simulated board, router and `site serve` at the
office, and the page's own feed (tests/support/far_watch.py); two network namespaces and an emulated
link between them. Both places have this machine's clock, so ages are true.

Usage: python tests/bench/bench_far.py [--json] [--congestion cubic|bbr] [--syn-retries 2]
       [--zenohd PROGRAM, which routes at both places in place of our router]
       [--cuts 5,30,120] [--rate 1e6] [--delay 0.1] [--loss 0.05] [--seconds 60] [--copy 9000000]
"""

import argparse
import json
import random
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
SESSION = "20261129-120000-copied"
SHARE = 1448 / 1500  # of a packet that is no header of IP and TCP
COARSE = 60  # moments of an overview
SERVICES = (("router",), ("site", "serve"))


def main() -> None:
    arguments = parsed()
    line = Line(arguments.rate, arguments.delay, arguments.loss)
    with tempfile.TemporaryDirectory() as folder:
        with far_site(
            Path(folder),
            line,
            services=SERVICES,
            congestion=arguments.congestion,
            syn_retries=arguments.syn_retries,
            zenohd=arguments.zenohd,
        ) as site:
            watcher = Watcher(site)
            found = {"first_picture_s": until(lambda: watcher.lines, PATIENCE_S, "a picture")}
            time.sleep(20.0)  # estimators begin, the rate is found
            found |= live(site, watcher, arguments.seconds)
            for seconds in arguments.cuts:
                found |= cut(site, watcher, seconds)
            if arguments.copy:
                found |= copied(site, watcher, arguments.copy)
            found["counted_as_lost"] = watcher.lines[-1]["lost"]
    about = {"bench": "far", "congestion": arguments.congestion, "rate": line.rate}
    about |= {"router": "zenohd" if arguments.zenohd else "gyrofree"}
    about |= {"delay_s": line.delay_s, "loss": line.loss}
    if arguments.json:
        print(json.dumps(about | found))
        return
    print(", ".join(f"{name} {value}" for name, value in about.items()))
    for name, value in found.items():
        print(f"{name:32} {value:10.2f}")


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--congestion", default="cubic")
    parser.add_argument(
        "--cuts", default="5,30,120", type=lambda s: [float(x) for x in s.split(",")]
    )
    parser.add_argument("--syn-retries", type=int, default=2)
    parser.add_argument("--zenohd", type=Path)
    parser.add_argument("--rate", type=float, default=1e6)
    parser.add_argument("--delay", type=float, default=0.1)
    parser.add_argument("--loss", type=float, default=0.05)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--copy", type=int, default=9_000_000)
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


def copied(site: FarSite, watcher: Watcher, size: int) -> dict[str, float]:
    """A recording of so many bytes, while the picture goes on."""
    folder, first = site.lab / "var/sessions" / SESSION, len(watcher.lines)
    folder.mkdir(parents=True)
    (folder / "recording.mcap").write_bytes(random.Random(1).randbytes(size))
    (folder / "session.json").write_text(json.dumps({"id": SESSION, "state": "closed"}))
    there = site.office / "var/sessions" / SESSION / "session.json"
    seconds = until(there.exists, 20 * PATIENCE_S, "the copy")
    line = site.link.line
    allowed = 8 * size / (line.rate * (1.0 - line.loss) * SHARE)
    return {
        "copy_s": seconds,
        "copy_allowed_s": allowed,
        "copy_over_allowed": seconds / allowed,
        **ages(watcher, first, "age_while_copying"),
    }


if __name__ == "__main__":
    try:
        main()
    except NoNamespaces as error:
        raise SystemExit(f"bench_far: no network namespaces here: {error}") from None
