"""A short run of the fuzzers from a fixed seed; `make fuzz` goes on for as long as one likes."""

import os
import re
import shutil

import fuzz
import pytest

pytestmark = pytest.mark.skipif(
    not shutil.which("clang") and not os.environ.get("CI"),
    reason="no clang: run make system-packages",
)


@pytest.mark.parametrize(("target", "runs"), [("decoder", 30_000), ("command", 2_500)])
def test_nothing_breaks_it(tmp_path, target, runs):
    done = fuzz.run(
        target, fuzz.build(target, tmp_path), tmp_path, "-seed=1", f"-runs={runs}", "-len_control=0"
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert int(re.search(r"number_of_executed_units: (\d+)", done.stderr)[1]) >= runs


def test_a_fault_is_found(tmp_path, monkeypatch):
    """The fuzzer can fail: without the check of the longest chunk it writes beyond the decoder's
    buffer.
    """
    frame = fuzz.ROOT / "firmware_protocol" / "core" / "gf_frame.c"
    broken = tmp_path / "gf_frame.c"
    text = frame.read_text()
    assert "d->size == GF_MAX_BODY" in text
    broken.write_text(text.replace("d->size == GF_MAX_BODY", "d->size == GF_MAX_BODY + 200"))
    monkeypatch.setattr(
        fuzz, "SOURCES", [broken if source == frame else source for source in fuzz.SOURCES]
    )
    done = fuzz.run(
        "decoder",
        fuzz.build("decoder", tmp_path),
        tmp_path,
        "-seed=1",
        "-runs=30000",
        "-len_control=0",
    )
    assert done.returncode != 0 and "SUMMARY" in done.stderr
