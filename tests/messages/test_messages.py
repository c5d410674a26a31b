"""The contract of the bus: generated code, topic table, session."""

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.bus.session import (
    BusSettings,
    BusUnavailable,
    Publishers,
    connected,
    decode,
    open_client,
    open_router,
    subscribe,
)
from messages.contract import gyrofree_pb2 as pb
from messages.contract import topics
from messages.contract.document import INTRODUCTION

ROOT = Path(__file__).resolve().parents[2]
names = st.from_regex(topics.NAME, fullmatch=True)


def test_generated_code_is_current(tmp_path):
    command = [
        sys.executable,
        "-m",
        "grpc_tools.protoc",
        f"-I{ROOT / 'messages' / 'contract'}",
        f"--python_out={tmp_path}",
    ]
    subprocess.run([*command, f"--pyi_out={tmp_path}", "gyrofree.proto"], check=True, timeout=60)
    for name in ("gyrofree_pb2.py", "gyrofree_pb2.pyi"):
        assert (tmp_path / name).read_text() == (
            ROOT / "messages" / "contract" / name
        ).read_text(), "run `make messages`"


def test_document_is_current():
    assert (ROOT / "docs" / "topics.md").read_text() == INTRODUCTION + topics.markdown(), (
        "run `make docs`"
    )


def test_every_message_of_ours_that_is_recorded_carries_a_header_first():
    for topic in topics.TOPICS:
        if topic.type.DESCRIPTOR.full_name.startswith("gyrofree."):
            assert topic.type.DESCRIPTOR.fields_by_name["header"].number == 1, topic.name


@given(prefix=names, device=names, estimator=names, topic=st.sampled_from(topics.TOPICS))
def test_a_key_taken_apart_is_what_it_was_made_of(prefix, device, estimator, topic):
    address = topics.parse(topic.key(prefix, device, estimator))
    assert address == topics.Address(
        prefix, device, topic, estimator if topic.per_estimator else ""
    )


@pytest.mark.parametrize(
    "key", ["", "gyrofree", "a/b/unknown", "a/b/rate", "a/b/accel/x", "a/b/rate/x/y"]
)
def test_strange_keys_are_refused(key):
    with pytest.raises(topics.TopicError, match="want"):
        topics.parse(key)


@pytest.mark.parametrize("name", ["", "Cube", "1cube", "a/b", "*", "a b", "x" * 33, "../x"])
def test_names_that_cannot_stand_in_a_key_are_refused(name):
    with pytest.raises(topics.TopicError, match="want a-z"):
        topics.ACCEL.key("gyrofree", name)


def test_foreign_bytes_are_no_message(caplog):
    assert decode(topics.ACCEL, b"\xff\xff\xff") is None
    assert "accel" in caplog.text


def test_a_client_without_router_says_what_to_do(free_port):
    with pytest.raises(BusUnavailable, match="gyrofree router"):
        open_client(BusSettings(router=f"tcp/127.0.0.1:{free_port}"), timeout_s=0.3)


def test_a_client_may_start_before_its_router_and_messages_arrive(free_port):
    endpoint = f"tcp/127.0.0.1:{free_port}"
    settings = BusSettings(router=endpoint, listen=[endpoint])
    opened = []
    waiting = threading.Thread(target=lambda: opened.append(open_client(settings, timeout_s=30)))
    waiting.start()
    with open_router(settings) as router:
        waiting.join(30)
        with opened[0] as client:
            end = time.monotonic() + 10
            while not connected(client):
                assert time.monotonic() < end, "the client did not find its router"
                time.sleep(0.02)
            received, got = [], threading.Event()
            subscribe(
                client,
                topics.RATE,
                settings.prefix,
                lambda key, m: (received.append((key, m)), got.set()),
            )
            publishers = Publishers(router, settings.prefix)
            for _ in range(100):  # the subscription travels to the router on its own time
                publishers.put(topics.RATE, "cube", pb.RateEstimate(estimator="x"), "x")
                if got.wait(0.1):
                    break
            key, message = received[0]
            assert key == "gyrofree/cube/rate/x"
            assert message.estimator == "x"
            assert message.header.sequence >= 1
