"""The photo of a unit, sent from the page: in pieces, by operators, told by content and size."""

import shutil

from support.front_door import open_door

from sessions.report.photo import MOST_BYTES
from tests.sessions.test_photo import drawn
from tests.support.table_session import SESSION, table_root


def sent(client, data: bytes, name="photo.jpg"):
    begun = client.post("/api/imports", json={})
    if begun.status_code != 200:
        return begun
    upload, piece = begun.json()["upload"], begun.json()["piece_bytes"]
    for at in range(0, len(data), piece):
        where = f"/api/imports/{upload}/files/{name}?at={at}"
        answer = client.post(where, content=data[at : at + piece])
        if answer.status_code != 200:
            return answer
    return client.post(f"/api/sessions/{SESSION}/photo", json={"upload": upload})


def test_a_photo_is_kept_and_shown_and_what_is_none_is_refused(tmp_path):
    shutil.copytree(table_root(), tmp_path / "sessions")
    big = drawn("PNG", (1500, 1500), compress_level=0)
    with open_door(tmp_path, scene=False) as door:
        with door.client("vera") as client:
            assert sent(client, drawn()).status_code == 403
            assert client.get(f"/api/sessions/{SESSION}/photo").status_code == 404
            assert 'id="photo"' not in client.get(f"/sessions/{SESSION}").text
        with door.client("otto") as client:
            refused = sent(client, b"<script>alert(1)</script>")
            assert refused.status_code == 422 and "JPEG" in refused.json()["error"]
            assert sent(client, bytes(MOST_BYTES + 1)).status_code == 413
            assert sent(client, b"t_s\n", "log.csv").status_code == 409
            kept = sent(client, big, "photo.png")
            assert kept.status_code == 200 and len(big) > 65_536
            page = client.get(f"/sessions/{SESSION}").text
            assert f"photo?{kept.json()['sha256'][:8]}" in page
        with door.client("vera") as client:
            shown = client.get(f"/api/sessions/{SESSION}/photo")
            assert shown.headers["content-type"] == "image/jpeg"
            assert shown.headers["x-content-type-options"] == "nosniff"
            assert (
                client.post(f"/api/sessions/{SESSION}/photo", json={"upload": 1}).status_code == 403
            )
