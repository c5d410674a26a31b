"""What one user may take of room that is everybody's, and headers that close what we do not use."""

import pytest
from support.front_door import open_door

from dashboard.web import intake_api

PIECE = b"t,fx_mps2\n" * 6000


@pytest.fixture
def door(tmp_path):
    with open_door(tmp_path, scene=False, upload_bytes_per_user=1 << 20) as opened:
        yield opened


def test_a_user_has_so_much_under_way_and_takes_nobody_elses_room(door, monkeypatch):
    with door.client("otto") as otto, door.client("anna") as anna:
        hers = anna.post("/api/imports").json()["upload"]
        numbers = [otto.post("/api/imports").json()["upload"] for _ in range(9)]
        codes = []
        for k in range(40):
            url = f"/api/imports/{numbers[-1 - k % 2]}/files/imu.csv?at={len(PIECE) * (k // 2)}"
            codes.append(otto.post(url, content=PIECE).status_code)
        assert codes.count(200) == (1 << 20) // len(PIECE) and codes[-1] == 413
        assert door.front.ended["an upload over its user's quota"] == codes.count(413)
        gone = otto.post(f"/api/imports/{numbers[0]}/files/imu.csv", content=PIECE)
        assert gone.status_code == 404  # the oldest of his own gave way, not hers
        url = f"/api/imports/{hers}/files/imu.csv"
        assert anna.post(url, content=PIECE).status_code == 200
        monkeypatch.setattr(intake_api, "LEAST_FREE", 1 << 60)
        full = anna.post(f"{url}?at={len(PIECE)}", content=PIECE)
        assert full.status_code == 507 and "free" in full.json()["error"]


def test_every_answer_closes_what_our_pages_do_not_use(door):
    with door.client("otto") as client:
        for path in ("/", "/account", "/api/me", "/api/none", "/static/gyrofree.css"):
            headers = client.get(path).headers
            assert headers["cross-origin-opener-policy"] == "same-origin"
            assert headers["cross-origin-resource-policy"] == "same-origin"
            assert headers["referrer-policy"] == "same-origin"
            assert "camera=()" in headers["permissions-policy"]
            assert headers["cache-control"] == "no-store"
            assert headers["x-permitted-cross-domain-policies"] == "none"
