"""Small disks that a scenario fills, lets fail or hang."""

import contextlib
import subprocess
from pathlib import Path

SIZE = 256 << 20  # bytes; a whole run of faults writes a hundred MB of journals
BLOCK = 1 << 16


class NoDevice(OSError):
    """This machine gives us no disk of our own, and why."""


class Disk:
    """A tmpfs at a path, if this is root and the kernel lets us; else an ordinary folder."""

    def __init__(self, path: Path, size: int = SIZE) -> None:
        path.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._filler = path / "filler"
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(path)], capture_output=True
        )
        self.small = done.returncode == 0

    def fill(self) -> None:
        """To the last byte."""
        with self._filler.open("ab", buffering=0) as filler:
            for size in (BLOCK, 1):
                try:
                    while filler.write(b"\0" * size) == size:
                        pass
                except OSError:
                    continue

    def free(self) -> None:
        """What was filled is empty again."""
        self._filler.unlink(missing_ok=True)

    def close(self) -> None:
        """Take it away, with all that is on it."""
        if self.small:
            self.free()
            subprocess.run(["umount", "-l", str(self.path)], check=False)


class Device(Disk):
    """An ext4 on a device of its own, which can fail and hang as a disk does."""

    def __init__(self, path: Path, size: int = SIZE) -> None:
        """Raises NoDevice."""
        path.mkdir(parents=True, exist_ok=True)
        self.path, self.small = path, True
        self._filler, self._image = path / "filler", path.with_name(f"{path.name}.img")
        with self._image.open("wb") as image:
            image.truncate(size)
        _run("mkfs.ext4", "-q", "-m", "0", self._image)
        self._mount()

    def _mount(self) -> None:
        # a device of its own each time: the kernel would give back the file system that failed
        self._device = _run("losetup", "--find", "--show", self._image)
        _run("mount", "-o", "errors=remount-ro", self._device, self.path)

    def fail(self) -> None:
        """The file system finds an error, and the kernel makes it read-only on the spot."""
        sign = Path("/sys/fs/ext4") / Path(self._device).name / "trigger_fs_error"
        sign.write_text("of a test")

    def replace(self) -> None:
        """As a person does: unmount, check, mount again. Who has files open keeps the dead ones."""
        self._unmount()
        with contextlib.suppress(NoDevice):
            _run("e2fsck", "-p", self._image)  # its code says that it mended something
        self._mount()

    def hang(self, hangs: bool) -> None:
        """Who writes waits, until it goes on."""
        _run("fsfreeze", "--freeze" if hangs else "--unfreeze", self.path)

    def _unmount(self) -> None:
        _run("umount", "--lazy", self.path)
        _run("losetup", "--detach", self._device)  # when its last file is closed

    def close(self) -> None:
        """Take it away, with all that is on it."""
        self._unmount()
        self._image.unlink()


def _run(*words: object) -> str:
    """What a command says; raises NoDevice."""
    try:
        done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    except FileNotFoundError as error:
        raise NoDevice(error) from None
    if done.returncode:
        raise NoDevice(f"{words[0]}: {done.stderr.strip()}")
    return done.stdout.strip()
