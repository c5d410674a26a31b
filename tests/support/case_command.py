"""Stands for `gyrofree` while a case runs: the real command, and a line of JSON of how it ended.

case_command.py ARGUMENTS...       $CASE_LOG is the file of lines; services are the command itself
"""

import json
import os
import subprocess
import sys

SERVICES = ("router", "gateway", "estimator", "record", "dashboard", "simulate", "play", "demo")
TIMEOUT_S = 120


def main(arguments: list[str]) -> int:
    command = [sys.executable, "-P", "-m", "gyrofree", *arguments]
    if not arguments or arguments[0] in (*SERVICES, "replay"):
        os.execv(sys.executable, command)
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    line = {
        "arguments": arguments,
        "code": done.returncode,
        "out": done.stdout,
        "err": done.stderr,
        "folder": os.getcwd(),
    }
    with open(os.environ["CASE_LOG"], "a", encoding="utf-8") as log:
        log.write(json.dumps(line) + "\n")
    sys.stdout.write(done.stdout)
    sys.stderr.write(done.stderr)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
