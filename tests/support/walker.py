"""Command lines by the hundred, each in a process of its own: one process loads the product once
and forks for every call.

A call chooses what its standard streams are and may run as nobody, for whom permissions hold.
"""

import contextlib
import dataclasses
import fcntl
import importlib
import io
import json
import os
import pkgutil
import resource
import signal
import subprocess
import sys
import tempfile
import time

NOBODY = 65534
LARGEST = 200_000_000  # bytes of a file that a call may write


@dataclasses.dataclass(frozen=True)
class Call:
    """A command line and what is around it."""

    line: tuple[str, ...]
    folder: str
    stdin: str = "empty"  # or "closed", or text
    stdout: str = "file"  # or "closed", "full", "gone" (a pipe that nobody reads)
    nobody: bool = False
    largest: int = LARGEST  # bytes of a file; what is more is refused as by a full disk
    seconds: float = 60.0
    tells: float = 0.0  # s, after which SIGTERM is sent: for what runs until then


@dataclasses.dataclass(frozen=True)
class Answer:
    """What a call left behind."""

    code: int | None  # None: it did not end; negative: by a signal
    out: str
    err: str
    seconds: float


class Walker:
    """Makes calls; close it, or use it as a context."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ
            | {
                "PYTHONUNBUFFERED": "1",
                "COLUMNS": "160",
                "NO_COLOR": "1",
                "OPENBLAS_NUM_THREADS": "1",
            },
        )

    def __call__(self, call: Call) -> Answer:
        self._process.stdin.write(json.dumps(dataclasses.asdict(call)) + "\n")
        self._process.stdin.flush()
        return Answer(**json.loads(self._process.stdout.readline()))

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait(30)

    def __enter__(self) -> "Walker":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _serve() -> None:
    """Read calls, fork for each, write answers."""
    _load()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for line in sys.stdin:
        call = Call(**json.loads(line))
        answers.write(json.dumps(dataclasses.asdict(_answer(call))) + "\n")
        answers.flush()


def _load() -> None:
    """Import what commands import when they are called."""
    for name in ("gyrofree", "inertial", "logs", "sessions", "estimator"):
        package = importlib.import_module(name)
        for module in pkgutil.walk_packages(package.__path__, f"{name}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)


def _answer(call: Call) -> Answer:
    """What it says goes through a pipe: no limit of files holds there."""
    with tempfile.TemporaryFile() as out:
        said, err = os.pipe2(os.O_CLOEXEC)
        fcntl.fcntl(err, fcntl.F_SETPIPE_SZ, 1 << 20)
        start = time.monotonic()
        child = os.fork()
        if child == 0:
            _be(call, out.fileno(), err)
        os.close(err)
        code = _wait(call, child, start)
        seconds = time.monotonic() - start
        out.seek(0)
        with os.fdopen(said, "rb") as stream:
            texts = [one.read().decode("utf-8", "backslashreplace") for one in (out, stream)]
        return Answer(code, *texts, seconds)


def _wait(call: Call, child: int, start: float) -> int | None:
    told = False
    pause = 0.002
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        passed = time.monotonic() - start
        if done:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)
            return os.waitstatus_to_exitcode(status)
        if call.tells and passed > call.tells and not told:
            os.kill(child, signal.SIGTERM)
            told = True
        if passed > call.seconds:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return None
        time.sleep(pause)
        pause = min(pause * 1.3, 0.05)


def _be(call: Call, out: int, err: int) -> None:
    """The child: streams, user, folder, and then the command as its entry point runs it."""
    code = 99
    try:
        os.setsid()
        os.dup2(err, 2)
        _streams(call, out)
        os.chdir(call.folder)
        resource.setrlimit(resource.RLIMIT_FSIZE, (call.largest, call.largest))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if call.nobody:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            os.environ["HOME"] = "/nonexistent"
        from gyrofree.commands.main import main

        sys.argv = ["gyrofree", *call.line]
        code = _exit_code(main)
    finally:
        os._exit(code)


def _streams(call: Call, out: int) -> None:
    if call.stdin == "closed":
        os.close(0)
        sys.stdin = None
    else:
        with tempfile.TemporaryFile() as file:
            file.write(b"" if call.stdin == "empty" else call.stdin.encode())
            file.seek(0)
            os.dup2(file.fileno(), 0)
        sys.stdin = io.TextIOWrapper(io.FileIO(0, closefd=False), encoding="utf-8")
    if call.stdout == "closed":
        os.close(1)
        sys.stdout = None
    else:
        if call.stdout == "full":
            out = os.open("/dev/full", os.O_WRONLY)
        elif call.stdout == "gone":
            read, out = os.pipe()
            os.close(read)
        os.dup2(out, 1)
        sys.stdout = io.TextIOWrapper(
            io.BufferedWriter(io.FileIO(1, "w", closefd=False)), encoding="utf-8"
        )
    sys.stderr = io.TextIOWrapper(
        io.BufferedWriter(io.FileIO(2, "w", closefd=False)),
        encoding="utf-8",
        errors="backslashreplace",
        line_buffering=True,
    )


def _exit_code(main) -> int:
    """As the interpreter ends: traceback, exit code, and 120 where a stream cannot be flushed."""
    import threading
    import traceback

    try:
        main()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
        code = 1
    threading._shutdown()
    import atexit

    atexit._run_exitfuncs()
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError) as error:
        print(f"Exception ignored in: <stdout>\n{error!r}", file=sys.stderr)
        code = 120
    sys.stderr.flush()
    return code


if __name__ == "__main__":
    _serve()
