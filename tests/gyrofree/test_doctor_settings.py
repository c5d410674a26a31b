"""`gyrofree doctor` says what running estimators doubt, over a real bus."""

import json
import threading

from support.stack import free_port
from typer.testing import CliRunner

from gyrofree.commands.main import app
from messages.bus.session import BusSettings, Publishers, open_client, open_router
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ESTIMATOR

DOUBT = "tachometer over estimate = 3.6 at every rate"


def speak(bus, stop):
    """Two devices, once and again: one with a doubt of its settings, one without."""
    with open_client(bus) as session:
        publishers = Publishers(session, bus.prefix)
        while not stop.wait(0.2):
            for device, message in (("cube", f"settings: {DOUBT}"), ("other", "")):
                header = pb.Header(device=device)
                status = pb.EstimatorStatus(
                    header=header, estimator="products-ekf", message=message
                )
                publishers.put(ESTIMATOR, device, status, "products-ekf")


def test_doctor_tells_a_doubted_setting_of_each_running_device(tmp_path, monkeypatch):
    address = f"tcp/127.0.0.1:{free_port()}"
    bus = BusSettings(router=address, listen=[address])
    (tmp_path / "gyrofree.toml").write_text(f'[bus]\nrouter = "{address}"\nlisten = ["{address}"]')
    monkeypatch.chdir(tmp_path)
    stop = threading.Event()
    with open_router(bus):
        speaker = threading.Thread(target=speak, args=(bus, stop))
        speaker.start()
        try:
            result = CliRunner().invoke(app, ["doctor", "--json"])
        finally:
            stop.set()
            speaker.join()
    found = {row["check"]: row for row in json.loads(result.stdout)}
    assert found["settings of cube"]["state"] == "warn"
    assert DOUBT in found["settings of cube"]["found"]
    assert found["settings of other"]["state"] == "ok"
