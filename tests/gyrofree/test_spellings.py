"""One log in many spellings: run, imported or played, it is the same samples to the bit, and the
same is said of it.
"""

import json
import os
import re

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.wire import Wire
from typer.testing import CliRunner

from estimator.pipeline import Pipeline
from estimator.settings import EstimatorSettings
from gateway.board.device import DeviceLink
from gateway.ports.reader import Chunk
from gateway.settings import DeviceSettings, GatewaySettings
from gateway.virtual.virtual_board import PLAYED, VirtualBoard
from gyrofree.commands.main import app
from gyrofree.running.log_items import items_of
from inertial.layouts.catalogue import CUBE
from inertial.simulation.table import TableTest
from logs.board_log import CUBE_AXES, read_board_log
from logs.cube_log import read_log
from messages.contract.topics import ACCEL, ESTIMATOR, RATE, parse
from messages.history.journal_file import BOARD, scan
from sessions.recording.mcap_log import read

SAMPLES = 400
PERIOD_MS = 10
EXAMPLES = int(os.environ.get("GYROFREE_SPELLINGS", "2"))


@st.composite
def logs(draw):
    """Times in ms (n,), counts (n, 12) of a cube that is turned, with holes and a spoilt axis."""
    test = TableTest(seed=draw(st.integers(0, 50)), profile="fast", layout=CUBE(0.05))
    block = np.concatenate([test.block(k).counts for k in range(5)])  # it begins at rest
    counts = np.array(block[:SAMPLES], dtype=int)
    fault = draw(st.sampled_from(["", "", "stuck", "offset"]))
    if fault:
        axis = draw(st.integers(0, 11))
        counts[150:, axis] = counts[150, axis] if fault == "stuck" else counts[150:, axis] + 150
    t_ms = draw(st.sampled_from([0, draw(st.integers(0, 50_000))])) + PERIOD_MS * np.arange(SAMPLES)
    kept = np.ones(SAMPLES, dtype=bool)
    for hole in draw(st.lists(st.integers(20, SAMPLES - 20), max_size=2)):
        kept[hole : hole + draw(st.integers(1, 9))] = False
    return t_ms[kept], counts[kept]


@st.composite
def spellings(draw):
    """How a program may write it: separator, decimal sign, unit of time, order, line ends."""
    separator = draw(st.sampled_from([";", "\t", ","]))
    return {
        "separator": separator,
        "comma": separator != "," and draw(st.booleans()),
        "time": draw(st.sampled_from(["t_s", "t_ms", "t_us", "Time (ms)", "timestamp_ns"])),
        "order": draw(st.permutations(range(12))),
        "line": draw(st.sampled_from(["\n", "\r\n"])),
        "encoding": draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"])),
        "more": draw(st.booleans()),
    }


PER_MS = {"t_s": None, "t_ms": 1, "Time (ms)": 1, "t_us": 1000, "timestamp_ns": 1_000_000}


def written(path, log, separator=",", comma=False, time="t_s", order=range(12), line="\n", **how):
    """The log in this spelling."""
    t_ms, counts = log
    head = [time, *(f"{CUBE_AXES[k]}_counts" for k in order)] + ["remark"] * how.get("more", False)
    rows = [separator.join(head)]
    for t, row in zip(t_ms.tolist(), counts.tolist(), strict=True):
        stamp = f"{t // 1000}.{t % 1000:03d}" if PER_MS[time] is None else str(t * PER_MS[time])
        cells = [stamp.replace(".", ",") if comma else stamp, *(str(row[k]) for k in order)]
        rows.append(separator.join(cells + ["ok"] * how.get("more", False)))
    path.write_bytes((line.join(rows) + line).encode(how.get("encoding", "utf-8")))
    return path


def gyrofree(*words):
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def said(text):
    """Without what names the file itself."""
    return re.sub(r"(plain|other)(-\d)?\.csv", "log.csv", text)


def run(path):
    """Samples and words of `gyrofree run`."""
    log = read_log(path, CUBE_AXES)
    series = path.with_name("series.csv")
    series.unlink(missing_ok=True)
    result = gyrofree("run", path, "--json", "--out", series)
    found = json.loads(result.stdout) if result.stdout else {}
    for one in found.get("estimators", {}).values():
        one.pop("us_per_sample", None)
    return (
        log.t_s.tobytes(),
        log.counts.tobytes(),
        log.f_axis.tobytes(),
        series.read_bytes() if series.is_file() else b"",
        result.exit_code,
        said(result.stderr),
        said(json.dumps(found, sort_keys=True)),
    )


def imported(path, config):
    """Messages of the session that is made of it, and what was said."""
    result = gyrofree("import", path, "--device", "cube", "--json", "--config", config)
    assert result.exit_code == 0, result.stderr
    session = json.loads(result.stdout)["session"]
    file = config.parent / "sessions" / session / "recording.mcap"
    return file, said(result.stderr)


def recorded(file):
    """Keys and messages; what an estimator's work costs is another time another one."""
    rows = [(row.key, row.payload) for row in read(file)]
    return [
        row if parse(row[0]).topic is not ESTIMATOR else (row[0], status(row[1])) for row in rows
    ]


def status(payload):
    message = ESTIMATOR.type.FromString(payload)
    message.ClearField("us_per_sample")
    return message.SerializeToString(deterministic=True)


def decoded(file, topic):
    of_topic = [row.payload for row in read(file) if parse(row.key).topic is topic]
    return [topic.type.FromString(payload) for payload in of_topic]


def numbers(t_ms):
    """Sample numbers: what is missing was lost."""
    return ((t_ms - t_ms[0]) // PERIOD_MS).tolist()


def accel(payloads):
    """(counts, number, period) of every sample."""
    rows = []
    for message in payloads:
        counts = np.array(message.counts).reshape(-1, 12).tolist()
        rows += [(row, message.first_index + k) for k, row in enumerate(counts)]
    return rows, {message.period_s for message in payloads}


def played(path, folder):
    """What the gateway makes of the bytes that `gyrofree play` sends, and of its journal again."""
    source = read_board_log(path)
    board = VirtualBoard(Wire(), PLAYED, epoch=1, sample_period_s=source.timing.period_s)
    for item in items_of(source):
        board.take(item)
    board.finish()
    first = gated([bytes(board.link.data)], folder / "first")
    journal = sorted((folder / "first" / "cube").glob("*.gfj"))
    raw = [record.data for file in journal for _, _, record in scan(file.read_bytes()).records]
    return first, gated(raw, folder / "again"), source.notes


def gated(chunks, folder):
    device = DeviceSettings(name="cube", port="file:///none")
    link = DeviceLink(device, GatewaySettings(journal=folder, devices=[device]))
    heard = []
    link.out.direct(lambda topic, name, message: heard.append((topic, message)))
    for k, data in enumerate(chunks):
        link.journal.append(BOARD, data, 1_000_000_000 + k, 0)
        link.take(Chunk(BOARD, data, 1_000_000_000 + k))
    link.journal.close()
    link.spool.close()
    return [message for topic, message in heard if topic is ACCEL]


def rates(batches):
    pipeline = Pipeline(EstimatorSettings(rate=["products-ekf", "least-squares"], navigators=[]))
    out = [o.message for m in batches for o in pipeline.on(ACCEL, m) if o.topic is RATE]
    return [list(m.omega_ib_b_radps) for m in out]


@settings(
    max_examples=EXAMPLES,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(log=logs(), way=spellings())
def test_one_log_is_one_whatever_it_is_written_in_and_whoever_reads_it(log, way, tmp_path_factory):
    folder = tmp_path_factory.mktemp("spellings")
    config = folder / "gyrofree.toml"
    config.write_text(
        f'[recorder]\nroot = "{folder}/sessions"\n'
        '[estimator]\nrate = ["products-ekf", "least-squares"]\nnavigators = []\n'
    )
    plain, other = written(folder / "plain.csv", log), written(folder / "other.csv", log, **way)
    assert run(other) == run(plain)

    file, words = imported(plain, config)
    again, same_words = imported(other, config)
    assert same_words == words
    assert recorded(again) == recorded(file)

    first, journalled, notes = played(plain, folder / "plain")
    from_other, _, same_notes = played(other, folder / "other")
    assert [said(n) for n in same_notes] == [said(n) for n in notes]
    samples = accel(decoded(file, ACCEL))
    assert samples[0] == [(row.tolist(), k) for row, k in zip(log[1], numbers(log[0]), strict=True)]
    assert accel(first) == accel(journalled) == accel(from_other) == samples

    # a board that plays a log counts its time from 0; another origin is another rounding of times
    wanted, found = [list(m.omega_ib_b_radps) for m in decoded(file, RATE)], rates(first)
    assert wanted and len(found) == len(wanted)
    assert found == wanted or log[0][0] and np.allclose(found, wanted, rtol=1e-9, atol=1e-9)
    assert gyrofree("replay", file, "--check", "--config", config).exit_code == 0
