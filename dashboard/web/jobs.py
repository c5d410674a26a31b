"""Work that would keep the page waiting (reports, exports) in processes of its own, one at a time,
lowest priority.

The dashboard's process must stay idle: a busy one gives blank scenes. A job is a command of the
composition root that writes into a folder; its files are served when it has ended well.
"""

import itertools
import logging
import shutil
import subprocess
import tempfile
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dashboard.web.control import ControlError
from messages.text import plain

log = logging.getLogger(__name__)

KEPT = 20  # ended jobs; the files of older ones go
LONGEST_S = 3600.0  # s, then it is ended


@dataclass
class Job:
    """One piece of work."""

    number: int
    kind: str  # report, export
    session: str
    user: str
    out: Path  # folder of its files
    begun: float = field(default_factory=time.monotonic)
    ended: float | None = None
    state: str = "waiting"  # waiting, running, done, failed
    message: str = ""  # why it failed
    made: str = ""  # id of the session it made
    keeping: threading.Lock = field(default_factory=threading.Lock)  # its files are being moved

    @property
    def seconds(self) -> float:
        """Since it was asked for, s."""
        return (self.ended or time.monotonic()) - self.begun

    @property
    def files(self) -> list[Path]:
        """What it has written."""
        return (
            sorted(path for path in self.out.rglob("*") if path.is_file())
            if self.out.is_dir()
            else []
        )

    @property
    def bytes(self) -> int:
        """Size of what it has written so far."""
        return sum(path.stat().st_size for path in self.files)


class Jobs:
    """The queue; `command` stands before a job's own arguments, as [python, -m, gyrofree],
    `options` behind them.
    """

    def __init__(
        self,
        command: Sequence[str],
        options: Sequence[str] = (),
        longest_s: float = LONGEST_S,
    ) -> None:
        self._longest_s = longest_s
        self._options = list(options)
        self._command = [*(["nice", "-n", "5"] if shutil.which("nice") else []), *command]
        self._scratch = Path(tempfile.mkdtemp(prefix="gyrofree-jobs-"))
        self._numbers = itertools.count(1)
        self._jobs: OrderedDict[int, Job] = OrderedDict()
        self._lock = threading.Lock()
        self._turn = threading.Lock()  # one at a time
        self._process: subprocess.Popen[str] | None = None
        self._closed = False

    def start(
        self,
        kind: str,
        session: str,
        arguments: Sequence[str],
        user: str,
        accept: tuple[int, ...] = (0,),
        makes: str = "files",
        then: Callable[[], None] = lambda: None,
        hide: Sequence[str] = (),
    ) -> Job:
        """Queue `<command> <arguments>`; exit codes in `accept` are well; `then` is called at its
        end; `hide` are folders of this machine that no message shows. Raises ControlError.

        One that makes `files` gets `--out <folder>`; one that makes a `session` prints its id.
        """
        with self._lock:
            if sum(job.ended is None for job in self._jobs.values()) >= 8:
                raise ControlError("eight jobs wait already: try again when some are done")
            number = next(self._numbers)
            job = Job(number, kind, session, user, self._scratch / str(number))
            self._jobs[number] = job
            while len(self._jobs) > KEPT and next(iter(self._jobs.values())).ended is not None:
                shutil.rmtree(self._jobs.popitem(last=False)[1].out, ignore_errors=True)
        work = (job, list(arguments), accept, makes, then, tuple(hide))
        threading.Thread(target=self._run, args=work, name=f"job {number}", daemon=True).start()
        return job

    def get(self, number: int) -> Job | None:
        """A job that is remembered."""
        return self._jobs.get(number)

    def close(self) -> None:
        """End what runs and forget all files."""
        self._closed = True
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
        shutil.rmtree(self._scratch, ignore_errors=True)

    def _run(
        self,
        job: Job,
        arguments: list[str],
        accept: tuple[int, ...],
        makes: str,
        then: Callable[[], None],
        hide: Sequence[str] = (),
    ) -> None:
        with self._turn:
            if self._closed:
                job.ended, job.state = time.monotonic(), "failed"
                job.message = "the dashboard ended"
                return
            job.state = "running"
            well = False
            try:
                job.out.mkdir(parents=True, exist_ok=True)
                well = self._carry_out(job, arguments, accept, makes)
            except Exception as error:  # whatever it was, nobody may wait for this job for ever
                log.exception("job %d (%s of %s)", job.number, job.kind, job.session)
                job.message = str(error) or type(error).__name__
            finally:
                then()
                for folder in hide:
                    job.message = job.message.replace(folder, "")
                job.message = plain(job.message)
                job.ended = time.monotonic()
                job.state = "done" if well else "failed"

    def _carry_out(
        self, job: Job, arguments: list[str], accept: tuple[int, ...], makes: str
    ) -> bool:
        """Run the command to its end; raises OSError and ValueError when it cannot be started."""
        out = ["--out", str(job.out)] if makes == "files" else []
        process = self._process = subprocess.Popen(
            [*self._command, *arguments, *out, *self._options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        try:
            printed, said = process.communicate(timeout=self._longest_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            job.message = f"not done after {self._longest_s:g} s: given up"
            return False
        if process.returncode not in accept:
            job.message = (said.strip().splitlines() or [f"it ended with {process.returncode}"])[-1]
            return False
        if makes == "session":
            job.made = (printed.split() or [""])[-1]
            if not job.made:
                job.message = "it made no session and said nothing"
        return makes != "session" or bool(job.made)
