"""The command line as a stranger meets it: help, versions, exit codes, one line per fault and no
traceback.
"""

import json
import socket
import subprocess
import sys

from support.stack import free_port


def gyrofree(*arguments, cwd, stdin=""):
    command = [sys.executable, "-m", "gyrofree", *arguments]
    return subprocess.run(
        command, cwd=cwd, input=stdin, capture_output=True, text=True, timeout=120
    )


def refused(result, code, *wanted):
    assert result.returncode == code, result.stderr
    assert "Traceback" not in result.stderr
    assert result.stdout == ""
    for part in wanted:
        assert part in result.stderr


def test_version(tmp_path):
    assert gyrofree("--version", cwd=tmp_path).stdout.startswith("gyrofree 0.")


def test_a_wrong_key_names_file_line_section_and_nearest_key(tmp_path):
    (tmp_path / "gyrofree.toml").write_text("[dashboard]\nprot = 1\n")
    refused(
        gyrofree("doctor", cwd=tmp_path),
        2,
        "gyrofree.toml:2: [dashboard] has no key 'prot'",
        "'port'",
    )


def test_an_absent_configuration_is_refused(tmp_path):
    refused(
        gyrofree("gateway", "--config", "nowhere.toml", cwd=tmp_path),
        2,
        "nowhere.toml",
        "--config FILE",
    )


def test_an_unknown_estimator_is_refused_with_the_known_ones(tmp_path):
    (tmp_path / "gyrofree.toml").write_text("[estimator]\nrate = ['product-ekf']\n")
    refused(gyrofree("estimator", cwd=tmp_path), 2, "product-ekf", "products-ekf")


def test_a_taken_port_is_said_and_no_other_is_used(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        refused(
            gyrofree("demo", "--bus-port", port, cwd=tmp_path),
            3,
            f"bus port {port} is taken",
            "--bus-port",
        )
        free = str(free_port())
        refused(
            gyrofree("demo", "--port", port, "--bus-port", free, cwd=tmp_path),
            3,
            f"dashboard port {port} is taken",
            "--port",
        )
        (tmp_path / "gyrofree.toml").write_text(f"[bus]\nlisten = ['tcp/127.0.0.1:{port}']\n")
        refused(gyrofree("router", cwd=tmp_path), 3, port)


def test_a_log_that_cannot_be_played_is_named_by_file_row_and_column(tmp_path):
    header = "t_s,fx_mps2,fy_mps2,fz_mps2,wx_radps,wy_radps,wz_radps\n"
    (tmp_path / "cut.csv").write_text(
        header + "0,0,0,-9.8,0,0,0\n0.01,0,zero,-9.8,0,0,0\n0.02,0,0,-9.8,0,0,0\n"
    )
    refused(gyrofree("play", "cut.csv", cwd=tmp_path), 2, "cut.csv:3", "'fy_mps2'", "'zero'")
    refused(gyrofree("play", "absent.csv", cwd=tmp_path), 2, "absent.csv")
    (tmp_path / "columns.csv").write_text("time,value\n1,2\n")
    refused(gyrofree("play", "columns.csv", cwd=tmp_path), 2, "columns.csv:1")


def test_a_drive_wants_its_folder(tmp_path):
    refused(gyrofree("demo", "--source", "drive", cwd=tmp_path), 2, "--data FOLDER")
    refused(
        gyrofree("demo", "--source", "boat", cwd=tmp_path),
        2,
        "'table', 'emulated', 'arm', 'tilt' or 'drive'",
    )


def test_an_unknown_profile_is_refused(tmp_path):
    refused(
        gyrofree("simulate", "--profile", "gentle", cwd=tmp_path),
        2,
        "published, wobble, fast, still",
    )


def test_doctor_speaks_json(tmp_path):
    result = gyrofree("doctor", "--json", cwd=tmp_path)
    findings = json.loads(result.stdout)
    assert {"versions", "serial ports", "clock", "bus port", "journal folder"} <= {
        row["check"] for row in findings
    }
    assert all(row["state"] in ("ok", "warn", "fail") for row in findings)
    assert result.returncode == (1 if any(row["state"] == "fail" for row in findings) else 0)


def test_doctor_finds_no_life_where_there_is_none(tmp_path, free_port):
    (tmp_path / "gyrofree.toml").write_text(f"[bus]\nrouter = 'tcp/127.0.0.1:{free_port}'\n")
    result = gyrofree("doctor", "--health", "gateway", "--json", cwd=tmp_path)
    assert result.returncode == 1
    assert json.loads(result.stdout)[0]["state"] == "fail"


def test_users_are_added_listed_and_removed(tmp_path):
    added = gyrofree(
        "users", "add", "anna", "--role", "viewer", cwd=tmp_path, stdin="a long pass phrase\n"
    )
    assert added.returncode == 0
    assert json.loads(gyrofree("users", "list", "--json", cwd=tmp_path).stdout) == [
        {"name": "anna", "role": "viewer"}
    ]
    refused(
        gyrofree(
            "users", "add", "bob", "--role", "king", cwd=tmp_path, stdin="a long pass phrase\n"
        ),
        2,
        "king",
    )
    refused(
        gyrofree("users", "add", "bob", "--role", "viewer", cwd=tmp_path, stdin="short\n"),
        2,
        "password",
    )
    assert gyrofree("users", "remove", "anna", cwd=tmp_path).returncode == 0


def test_replay_names_the_recordings_there_are(tmp_path):
    refused(gyrofree("replay", "20200101-000000", cwd=tmp_path), 1, "no recording", "none")
    assert json.loads(gyrofree("replay", "--list", "--json", cwd=tmp_path).stdout) == []
