"""What a service says is kept for who misses some, and numbers decide whom one listens to."""

import time

import pytest
import zenoh
from support.stack import free_port

from messages.bus.claiming import Claim, Claimant
from messages.bus.fencing import Fence, packed
from messages.bus.session import BusSettings, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ALARM, ALARMS, ESTIMATES, claim_key
from messages.history import answers
from messages.history.keeping import KeptPublishers


@pytest.fixture
def bus():
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    settings = BusSettings(prefix="t", router=endpoint, listen=[endpoint])
    with open_router(settings), open_client(settings) as mine, open_client(settings) as other:
        yield mine, other


def test_what_was_said_can_be_asked_for_also_of_an_earlier_life(bus, tmp_path):
    mine, other = bus
    runs = []
    for _ in range(2):
        publishers = KeptPublishers(mine, "t", ALARMS, tmp_path / "kept", 1)
        runs.append(publishers.run)
        for _ in range(3):
            status = pb.AlarmStatus()
            status.header.device, status.header.run = "cube", publishers.run
            status.header.utc_ns = time.time_ns()
            publishers.put(ALARM, "cube", status)
        end = time.monotonic() + 30.0  # until the router has told the other session whom to ask
        while (found := answers.ask(other, "t", "cube", ALARMS, pb.HistoryQuery())) is None:
            assert time.monotonic() < end
        publishers.close()
    assert [(item.run, item.sequence) for item in found.items] == [
        (run, sequence) for run in runs for sequence in (1, 2, 3)
    ]
    assert runs[1] > runs[0]


def test_a_folder_that_another_process_has_is_said_and_costs_no_message(bus, tmp_path, caplog):
    mine, _ = bus
    first = KeptPublishers(mine, "t", ALARMS, tmp_path / "kept", 1)
    second = KeptPublishers(mine, "t", ALARMS, tmp_path / "kept", 2)
    assert "is not kept for who misses some" in caplog.text
    status = pb.AlarmStatus()
    status.header.device = "cube"
    second.put(ALARM, "cube", status)
    second.close()
    first.close()


@pytest.mark.parametrize("source, key", [(ESTIMATES, "t/cube/rate/any"), (ALARMS, "t/cube/alarm")])
def test_who_gives_no_number_is_heard_only_where_nobody_serves(bus, source, key):
    mine, other = bus
    refused = []
    fence = Fence(lambda key, why, device: refused.append((key, why.kind)))
    declared = fence.declare(other, "t")
    assert fence.admit(key, None) and not refused
    base, number = claim_key("t", source), time.time_ns()
    serving = Claim(Claimant(mine, other), [base], number)
    end = time.monotonic() + 30.0
    while number not in fence.claims.numbers(key):
        assert time.monotonic() < end
        time.sleep(0.01)
    assert not fence.admit(key, None) and refused == [(key, "claim")]
    assert fence.admit(key, zenoh.ZBytes(packed(number)))
    assert fence.admit(key.replace("cube", "cube-replay"), None)  # under a name of its own
    assert fence.admit("t/cube/note", None)  # anybody notes
    declared.undeclare()
    del serving
