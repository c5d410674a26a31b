"""/metrics of the dashboard: by an API token, and what all services say is in it."""

import math

import httpx
from prometheus_client.parser import text_string_to_metric_families as parsed
from support.front_door import open_door

from dashboard.data.store import Store
from dashboard.web.programs.tokens import issue_token
from messages.contract import gyrofree_pb2 as pb
from messages.contract.topics import ESTIMATOR, LINK, STATUS


def status_of(cls, device="cube", **fields):
    message = cls(**fields)
    message.header.device, message.header.utc_ns = device, 1_700_000_000_000_000_000
    return message


def test_a_viewers_token_reads_the_figures_of_all_services(tmp_path):
    store = Store()
    store.put(LINK, "cube", "", status_of(pb.LinkStatus, lost_samples=7, connected=True))
    store.put(LINK, "old-replay", "", status_of(pb.LinkStatus, "old-replay", lost_samples=9))
    said = status_of(pb.EstimatorStatus, estimator="ekf", samples=5, refused={"range": 3})
    store.put(ESTIMATOR, "cube", "ekf", said)
    store.put(STATUS, "recorder", "", status_of(pb.RecorderStatus, "recorder", recording=True))
    beat = pb.Beat(role="gateway", clock_ahead_s=math.nan, certificate_ends_utc_ns=5_000_000_000)
    beat.loop, beat.turn_ago_s, beat.turn_most_s = "link cube", 4.0, 3.0
    store.presence.beat("lab", "gateway-aa", beat)
    store.presence.beat("lab", "gateway-aa", beat)
    store.presence.look(1.0)
    with open_door(tmp_path, scene=False, store=store) as door:
        door.front.ended["asked for nothing"] += 2
        assert httpx.get(f"{door.url}/metrics").status_code == 401
        wrong = httpx.get(f"{door.url}/metrics", headers={"authorization": "Bearer gyf_none"})
        assert wrong.status_code == 401
        secret, _ = issue_token(door.settings.users, "vera", "prometheus", "viewer", 1.0)
        headers = {"authorization": f"Bearer {secret}"}
        answer = httpx.get(f"{door.url}/metrics", headers=headers)
        assert answer.status_code == 200 and "text/plain" in answer.headers["content-type"]
        strict = httpx.get(
            f"{door.url}/metrics", headers=headers | {"accept": "application/openmetrics-text"}
        )
        assert strict.text.endswith("# EOF\n")
    found = {
        (sample.name, *sample.labels.values()): sample.value
        for family in parsed(answer.text)
        for sample in family.samples
    }
    assert found["gyrofree_link_lost_samples_total", "cube"] == 7.0
    assert found["gyrofree_estimator_refused_messages_total", "cube", "ekf", "range"] == 3.0
    assert found["gyrofree_recorder_recording",] == 1.0
    assert found["gyrofree_dashboard_connections_ended_total", "asked for nothing"] == 2.0
    assert found["gyrofree_disk_free_bytes", "dashboard.users"] > 0.0
    assert found["process_resident_memory_bytes",] > 0.0
    service = "lab", "gateway-aa"
    assert found["gyrofree_service_turn_age_seconds", *service] >= 4.0
    assert found["gyrofree_service_turn_limit_seconds", *service] == 3.0
    assert found["gyrofree_service_running", *service] == 0.0  # it hangs
    assert found["gyrofree_service_certificate_end_timestamp_seconds", *service] == 5.0
    assert ("gyrofree_service_clock_ahead_seconds", *service) not in found  # not measured
    assert not any("old-replay" in key for key in found)
