"""The photo of a unit: told by its content, small, without what cameras add; in the report with its
digest.
"""

import hashlib
import io
import json
import shutil

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from sessions.report.build import build
from sessions.report.photo import EDGE, FILE, MOST_BYTES, PhotoError, keep, kept_form, read
from sessions.report.verdict import load_spec
from tests.support.table_session import table_recording


def drawn(form="JPEG", size=(300, 200), **options) -> bytes:
    stream = io.BytesIO()
    Image.linear_gradient("L").resize(size).convert("RGB").save(stream, form, **options)
    return stream.getvalue()


@pytest.mark.parametrize("form", ["JPEG", "PNG"])
def test_a_photo_is_kept_small_upright_and_without_where_it_was_taken(form):
    tags = Image.Exif()
    tags[0x0112], tags[0x010F] = 6, "maker of cameras"  # turned by 90 degrees
    kept = kept_form(drawn(form, (4000, 2000), exif=tags))
    with Image.open(io.BytesIO(kept)) as image:
        assert image.format == "JPEG" and image.size == (EDGE // 2, EDGE) and not image.getexif()
    assert b"maker" not in kept and kept_form(drawn()) == kept_form(drawn())


@pytest.mark.parametrize(
    "data, words",
    [
        (b"", "neither a JPEG nor a PNG"),
        (b"<svg onload='x'/>", "neither a JPEG nor a PNG"),
        (drawn("GIF"), "neither a JPEG nor a PNG"),
        (drawn()[:400], "damaged"),
        (bytes(MOST_BYTES + 1), "at most"),
        (drawn("PNG", (9000, 9000)), "at most 40,000,000"),
    ],
)
def test_what_is_no_photo_is_named(data, words):
    with pytest.raises(PhotoError, match=words):
        kept_form(data)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from([drawn(), drawn("PNG")]), st.data())
def test_damage_is_a_photo_or_a_sentence(whole, data):
    changed = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 8))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
    try:
        assert kept_form(bytes(changed)).startswith(b"\xff\xd8")
    except PhotoError:
        pass


def test_the_report_shows_it_with_its_digest_and_the_same_bytes(tmp_path):
    shutil.copytree(table_recording().parent, tmp_path / "s")
    path = tmp_path / "s" / "recording.mcap"
    kept = keep(path.parent, drawn())
    assert read(path.parent) == kept and [p.name for p in path.parent.glob("unit*")] == [FILE]
    assert kept.sha256 == hashlib.sha256((path.parent / FILE).read_bytes()).hexdigest()
    first, again = build(path, load_spec(None)), build(path, load_spec(None))
    assert (first.html, first.pdf, first.json) == (again.html, again.pdf, again.json)
    assert "data:image/jpeg;base64," in first.html and kept.sha256 in first.html
    assert json.loads(first.json)["photo_sha256"] == kept.sha256
