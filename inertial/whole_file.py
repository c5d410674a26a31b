"""A file that somebody named is written as a whole, or stays as it was."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A draft with the same ending, which becomes the file once it is written without a fault; with
    one it is gone, and a file that was there is as it was. Raises OSError.
    """
    path = Path(path)
    target = path.resolve() if path.is_file() else path  # a link stays one
    kept = path.exists() and not path.is_file() and not path.is_dir()
    folder = Path(tempfile.mkdtemp()) if kept else target.parent
    draft = folder / f".{os.getpid()}-draft{path.suffix}"
    try:
        yield draft
        if path.is_file():
            shutil.copymode(path, draft)
        put_in_place(draft, target)
    except OSError as error:
        if not error.errno:
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from None
    finally:
        draft.unlink(missing_ok=True)
        if kept:
            folder.rmdir()


@contextmanager
def whole_files(folder: Path) -> Iterator[Path]:
    """A folder of drafts, whose files come into `folder` together once they are written without a
    fault; with one, `folder` is as it was. Raises OSError.
    """
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    drafts = Path(tempfile.mkdtemp(prefix=".drafts-", dir=folder))
    try:
        yield drafts
        for draft in sorted(drafts.iterdir()):
            draft.replace(folder / draft.name)
    finally:
        shutil.rmtree(drafts, ignore_errors=True)
        for one in made:
            if any(one.iterdir()):
                break
            one.rmdir()


def put_in_place(draft: Path, path: Path) -> None:
    """The finished draft becomes the file. A device or a pipe is written to, and stays what it is:
    put in its place, a file would take /dev/null from the whole machine. Raises OSError.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        try:
            with path.open("wb") as stream, draft.open("rb") as written:
                shutil.copyfileobj(written, stream)
        finally:
            draft.unlink()
        return
    os.replace(draft, path)


def sync_folder(folder: Path) -> None:
    """Make new and renamed entries of a folder survive a power cut."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
