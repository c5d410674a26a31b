"""Figures for Prometheus: whatever the services publish, a server can read the text."""

import math
import re
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from prometheus_client import generate_latest
from prometheus_client.core import CollectorRegistry
from prometheus_client.openmetrics import exposition as openmetrics
from prometheus_client.openmetrics.parser import text_string_to_metric_families as strict
from prometheus_client.parser import text_string_to_metric_families as parsed

from gyrofree.operations.document import page
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics as tp
from messages.metrics.exposition import MOST, SILENT_S, Newest, OfMessages, Said
from messages.metrics.own import Own
from messages.metrics.table import FIGURES

ROOT = Path(__file__).resolve().parents[2]
UNITS = ("seconds", "bytes", "ratio", "hertz", "total", "messages", "records")
NUMBERS = st.integers(0, 2**53)
REALS = st.floats(allow_nan=True, allow_infinity=True)
WORDS = st.text(max_size=20)  # also quotes, backslashes, line ends
MAPS = st.dictionaries(WORDS, NUMBERS, max_size=4)


def text_of(*collectors, form=generate_latest) -> str:
    registry = CollectorRegistry(auto_describe=False)
    for each in collectors:
        registry.register(each)
    return form(registry).decode()


def series(text, parse=parsed) -> dict:
    found = {}
    for family in parse(text):
        for sample in family.samples:
            key = sample.name, tuple(sorted(sample.labels.items()))
            assert key not in found, f"twice: {key}"  # a server refuses the whole answer
            found[key] = sample.value
    return found


@st.composite
def messages(draw):
    """Every message that has figures, with any values and texts."""
    link = pb.LinkStatus(connected=draw(st.booleans()), latency_p50_s=draw(REALS))
    for field in ("bytes_in", "lost_samples", "journal_sequence", "durable_sequence"):
        setattr(link, field, draw(NUMBERS))
    for name in ("damage", "refused"):
        getattr(link, name).update(draw(MAPS))
    board = pb.BoardInfo(faults=[pb.Fault(name=n) for n in draw(st.lists(WORDS, max_size=3))])
    board.status.update(draw(MAPS))
    estimator = pb.EstimatorStatus(samples=draw(NUMBERS), behind_s=draw(REALS))
    estimator.refused.update(draw(MAPS))
    names = draw(st.lists(WORDS, max_size=3))
    states = st.sampled_from(pb.AxisHealth.State.values())
    axes = pb.AxisHealth(axes=[pb.AxisHealth.Axis(name=n, state=draw(states)) for n in names])
    recorder = pb.RecorderStatus(messages=draw(NUMBERS), durable_messages=draw(NUMBERS))
    for name in ("lost", "repaired", "refused"):
        getattr(recorder, name).update(draw(MAPS))
    alarms = pb.AlarmStatus(
        alarms=[pb.Alarm(id=n, active=True, level=pb.Alarm.LEVEL_WARNING) for n in names * 2]
    )
    procedure = pb.ProcedureStatus(state=draw(st.sampled_from(pb.ProcedureStatus.State.values())))
    return [
        (tp.LINK, link),
        (tp.BOARD, board),
        (tp.ESTIMATOR, estimator),
        (tp.AXES, axes),
        (tp.STATUS, recorder),
        (tp.ALARM, alarms),
        (tp.PROCEDURE, procedure),
    ]


@settings(max_examples=20, deadline=None)
@given(messages(), messages())
def test_whatever_is_said_can_be_read_and_stands_there_once(first, second):
    newest = Newest()
    for device, said in (("cube", first), ("cube2", second)):
        for topic, message in said:
            newest.take(topic, device, "ekf" if topic.per_estimator else "", message)
    collector = OfMessages(newest.said)
    found = series(text_of(collector))
    assert series(text_of(collector, form=openmetrics.generate_latest), strict).keys() >= {
        key for key in found if not key[0].startswith("gyrofree_message_age")
    }
    for k, (_, said) in enumerate((("cube", first), ("cube2", second))):
        of = (("device", "cube2" if k else "cube"),)
        assert found["gyrofree_link_lost_samples_total", of] == said[0][1].lost_samples
        undurable = said[0][1].journal_sequence - said[0][1].durable_sequence
        assert found["gyrofree_link_undurable_records", (*of, ("journal", "raw"))] == max(
            0, undurable
        )
        for reason, count in said[0][1].refused.items():
            assert found["gyrofree_link_refused_frames_total", (*of, ("reason", reason))] == count
    assert {figure.topic.name for figure in FIGURES} == {topic.name for topic, _ in first}


def test_names_say_their_kind_and_their_unit():
    for figure in FIGURES:
        assert re.fullmatch(r"gyrofree_[a-z_]+", figure.name)
        assert figure.name.endswith("_total") == (figure.kind == "counter"), figure.name
        assert not re.search(r"_(s|us|ms|hz|ppm|mb|percent)(_total)?$", figure.name)
        fields = {field.name for field in figure.topic.type.DESCRIPTOR.fields}
        assert "header" in fields and figure.text
    assert len({figure.name for figure in FIGURES}) == len(FIGURES)
    seconds = [f.name for f in FIGURES if "latency" in f.name or "behind" in f.name]
    assert seconds and all(name.endswith(UNITS) for name in seconds)


def test_what_is_not_known_now_is_absent_and_its_age_is_there(monkeypatch):
    said = Said(tp.STATUS, "recorder", "", pb.RecorderStatus(recording=True), 100.0)
    for now, there in ((100.0 + SILENT_S - 1, True), (100.0 + SILENT_S + 1, False)):
        monkeypatch.setattr("messages.metrics.exposition.time.monotonic", lambda now=now: now)
        found = series(text_of(OfMessages(lambda: [said])))
        assert (("gyrofree_recorder_recording", ()) in found) is there
        age = [value for (name, _), value in found.items() if name.endswith("age_seconds")]
        assert age == [now - 100.0]


def test_what_a_process_publishes_is_counted_and_bounded(tmp_path):
    own = Own({"recorder.root": tmp_path / "later" / "sessions"})
    for k in range(MOST + 10):
        own.newest.take(tp.ACCEL, f"b{k}", "", pb.AccelBatch())
    own.newest.take(tp.ACCEL, "b1", "", pb.AccelBatch())
    found = series(generate_latest(own.registry).decode())
    counted = {dict(l)["device"]: v for (n, l), v in found.items() if "published" in n}
    assert len(counted) == MOST and counted["b1"] == 2 and counted["b0"] == 1
    assert found["gyrofree_disk_free_bytes", (("folder", "recorder.root"),)] > 0
    assert any(name == "process_cpu_seconds_total" for name, _ in found)
    assert all(not math.isnan(value) for value in found.values())


def test_the_page_of_figures_is_the_codes():
    told = "docs/metrics.md is not the code's: python -m gyrofree.operations.document"
    assert (ROOT / "docs" / "metrics.md").read_text() == page(), told
