"""The journal: what was said is kept, whatever happens to disk and process."""

import random
import signal
import subprocess
import sys

import pytest
from support.waiting import until
from support.wall_clock import YEAR_S, WallClock

from messages.history.journal import Journal
from messages.history.journal_file import SEGMENT_HEAD, records, scan, walk
from messages.history.journal_folder import JournalBusy


def fill(journal: Journal, n: int, size: int = 100) -> None:
    for k in range(n):
        journal.append(0, bytes([k % 256]) * size, k, k)


def all_records(folder) -> list:
    return [
        r for name in sorted(folder.glob("*.gfj")) for _, _, r in scan(name.read_bytes()).records
    ]


def test_every_read_is_there_after_close_and_the_sequence_goes_on(tmp_path):
    first = Journal(tmp_path)
    fill(first, 50)
    first.close()
    assert first.durable_seq == 50
    second = Journal(tmp_path)
    assert second.run > first.run and second.last_seq == 50
    assert second.append(1, b"more", 7, 8) == 51
    second.close()
    got = all_records(tmp_path)
    assert [r.sequence for r in got] == list(range(1, 52))
    assert (got[-1].channel, got[-1].data, got[-1].monotonic_ns, got[-1].utc_ns) == (
        1,
        b"more",
        7,
        8,
    )


def test_durable_follows_by_itself(tmp_path):
    journal = Journal(tmp_path, sync_s=0.02)
    fill(journal, 5)
    until(lambda: journal.durable_seq == 5)
    journal.close()


@pytest.mark.parametrize("cut", range(1, 140, 13))
def test_torn_tail_is_cut(tmp_path, cut):
    journal = Journal(tmp_path)
    fill(journal, 20)
    journal.close()
    (name,) = tmp_path.glob("*.gfj")
    data = name.read_bytes()
    name.write_bytes(data[:-cut])
    again = Journal(tmp_path)
    assert again.last_seq == (19 if cut <= 137 else 18)
    fill(again, 1)
    again.close()
    assert [r.sequence for r in all_records(tmp_path)] == list(range(1, again.last_seq + 1))
    assert all(not scan(p.read_bytes()).damaged_bytes for p in tmp_path.glob("*.gfj"))


def test_any_damage_costs_only_the_records_it_hits(tmp_path):
    journal = Journal(tmp_path)
    fill(journal, 100)
    journal.close()
    (name,) = tmp_path.glob("*.gfj")
    clean = name.read_bytes()
    draw = random.Random(1)
    for _ in range(50):
        data = bytearray(clean)
        at = draw.randrange(SEGMENT_HEAD.size, len(data))
        data[at] ^= 1 << draw.randrange(8)
        found = scan(bytes(data))
        assert (
            len(found.records) == 99
            and found.damaged_bytes == len(clean[SEGMENT_HEAD.size :]) // 100
        )
        later = [record for record in found.records if record[2].sequence >= 60]
        assert (
            list(walk(bytes(data), first=60)) == later
        )  # those before are passed over, damage among them as well


def test_oldest_segments_go_first_and_history_says_what_is_left(tmp_path):
    journal = Journal(tmp_path, max_bytes=20_000, segment_bytes=2_000, sync_s=0.01)
    fill(journal, 500)
    journal.close()
    assert sum(p.stat().st_size for p in tmp_path.glob("*.gfj")) <= 20_000
    kept = journal.first_kept()
    assert 300 < kept <= 400
    got = [r.sequence for r in records(b"".join(journal.history(1, 10**9)))]
    assert got == list(range(kept, 501))
    assert [r.sequence for r in records(b"".join(journal.history(480, 490)))] == list(
        range(480, 491)
    )
    capped = [r.sequence for r in records(b"".join(journal.history(kept, 10**9, max_bytes=1000)))]
    assert capped == list(range(kept, kept + len(capped))) and 5 < len(capped) < 12


def test_second_journal_of_one_folder_is_refused_until_the_first_is_closed(tmp_path):
    first = Journal(tmp_path)
    fill(first, 3)
    with pytest.raises(
        JournalBusy, match="another gateway writes it; stop the other one"
    ) as refused:
        Journal(tmp_path)
    assert str(tmp_path) in str(refused.value)
    fill(first, 3)
    first.close()
    second = Journal(tmp_path)
    assert second.last_seq == 6
    second.close()
    assert [r.sequence for r in all_records(tmp_path)] == [1, 2, 3, 4, 5, 6]


def test_a_folder_that_can_be_used_late_is_continued_not_overwritten(tmp_path):
    folder = tmp_path / "journal"
    before = Journal(folder)
    fill(before, 10)
    before.close()
    folder.rename(tmp_path / "elsewhere")
    folder.write_text("a file where a folder is wanted")
    journal = Journal(folder)
    assert journal.append(0, b"lost", 1, 1) == 0 and "NOT KEPT" in journal.message
    folder.unlink()
    (tmp_path / "elsewhere").rename(folder)
    until(lambda: journal.append(0, b"kept", 1, 1))
    assert not journal.message
    journal.close()
    assert [r.sequence for r in all_records(folder)] == list(range(1, 12))


def test_message_of_a_failed_sync_clears_with_the_next_good_one(tmp_path, caplog):
    """The first segment is /dev/null: it takes writes, and fdatasync on it fails."""
    journal = Journal(tmp_path, segment_bytes=2_000, sync_s=0.01)
    (tmp_path / f"{1:020d}.gfj").symlink_to("/dev/null")
    fill(journal, 3)
    until(lambda: "fdatasync" in journal.message and "NOT SAFE" in journal.message)
    assert journal.durable_seq == 0
    fill(journal, 20)  # on into the next segment, a real one

    def cleared():
        fill(journal, 1)  # a good sync needs something to sync
        return not journal.message

    until(cleared)
    until(lambda: journal.durable_seq == journal.last_seq)
    journal.close()
    assert "records 1 to" in caplog.text and "may have holes" in caplog.text


FULL = """
import resource, signal, sys
from pathlib import Path
from messages.history.journal import Journal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
journal = Journal(Path(sys.argv[1]))
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, resource.RLIM_INFINITY))
kept = sum(bool(journal.append(0, bytes(100), k, k)) for k in range(100))
message, unkept = journal.message, journal.unkept_bytes
journal.close()
print(kept, unkept, message)
"""


def test_short_write_of_a_full_disk_is_cut_back(tmp_path):
    """A file size limit gives the same short write as a full disk, also to root."""
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    kept, unkept, message = done.stdout.split(maxsplit=2)
    assert int(kept) + int(unkept) // 100 == 100 and 20 < int(kept) < 50
    assert "NOT KEPT" in message and "free some space" in message
    (name,) = (p for p in tmp_path.glob("*.gfj") if p.stat().st_size > SEGMENT_HEAD.size)
    found = scan(name.read_bytes())
    assert len(found.records) == int(kept) and found.damaged_bytes == 0


def test_killed_while_writing(tmp_path):
    """kill -9: at the next start the sequence has no hole and nothing damaged stands in the
    files.
    """
    code = (
        "import sys,time;from pathlib import Path;from messages.history.journal import"
        " Journal;j=Journal(Path(sys.argv[1]))\nprint('go',flush=True)\nwhile True:"
        " j.append(0,bytes(777),1,2)"
    )
    child = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE)
    assert child.stdout.readline() == b"go\n"
    until(lambda: sum(p.stat().st_size for p in tmp_path.glob("*.gfj")) > 100_000)
    child.send_signal(signal.SIGKILL)
    child.wait(10)
    child.stdout.close()
    journal = Journal(tmp_path)
    last = journal.last_seq
    journal.close()
    assert last > 100 and [r.sequence for r in all_records(tmp_path)] == list(range(1, last + 1))


AGEING = """
import sys, time
from pathlib import Path
from messages.history.journal import Journal
folder = Path(sys.argv[1])
journal = Journal(folder, segment_bytes=2000, sync_s=0.02, max_age_s=3600.0)
print(journal.run, flush=True)
for line in sys.stdin:
    for _ in range(100):
        journal.append(0, b"x" * 100, time.monotonic_ns(), time.time_ns())
    time.sleep(0.2)
    print(len(journal.segments()), flush=True)
journal.close()
"""


@pytest.mark.parametrize("offset_s", [-YEAR_S, YEAR_S])
def test_a_set_wall_clock_removes_no_segment_and_leads_no_run_back(tmp_path, offset_s):
    wall = WallClock(tmp_path / "wall")
    runs = []
    for _ in range(2):
        with subprocess.Popen(
            [sys.executable, "-c", AGEING, str(tmp_path / "journal")],
            env=wall.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        ) as process:
            runs.append(int(process.stdout.readline()))
            counts = []
            for _ in range(2):
                process.stdin.write("\n")
                process.stdin.flush()
                counts.append(int(process.stdout.readline()))
                if len(runs) == 1:
                    wall.set(offset_s)
            if len(runs) == 1:
                assert counts[1] > counts[0] + 3
            process.stdin.close()
    assert runs[1] > runs[0]
