"""A file that somebody named is written as a whole, or stays as it was."""

import os
from pathlib import Path


def put_in_place(draft: Path, path: Path) -> None:
    """The finished draft becomes the file. A device or a pipe is written to, and stays what it is:
    put in its place, a file would take /dev/null from the whole machine. Raises OSError.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        try:
            with path.open("wb") as stream:
                stream.write(draft.read_bytes())
        finally:
            draft.unlink()
        return
    os.replace(draft, path)
