"""A file that somebody named is written as a whole, and a device stays one."""

import os
import stat
import threading

import pytest

from gateway.virtual.board_link import PtyLink
from inertial.toml_file import write_whole
from sessions.replay.reprocess import write_table


@pytest.mark.parametrize(
    "write", [lambda path: write_whole({"a": 1}, path), lambda path: write_table(path, [])]
)
def test_a_pipe_is_written_to_and_stays_a_pipe(write, tmp_path):
    path, heard = tmp_path / "pipe", []
    os.mkfifo(path)
    reader = threading.Thread(target=lambda: heard.append(path.read_bytes()))
    reader.start()
    write(path)
    reader.join(60.0)
    assert heard[0] and stat.S_ISFIFO(path.stat().st_mode)
    assert [one.name for one in tmp_path.iterdir()] == ["pipe"]


def test_a_simulated_board_takes_no_file_for_its_link(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t_s\n0\n")
    with pytest.raises(FileExistsError, match=r"log\.csv"):
        PtyLink(path)
    assert path.read_text() == "t_s\n0\n"
    name = tmp_path / "board"
    PtyLink(name)  # one that was killed leaves its link
    link = PtyLink(name)
    assert name.is_symlink()
    link.close()
    assert not name.is_symlink()
