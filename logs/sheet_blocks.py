"""A CSV file in blocks of whole lines, as UTF-8, parsed one by one.

The parser is given memory, never a stream of ours: what reads ahead in threads of its own would
still hold the stream when the interpreter ends, and that stops a process in the middle of nothing.
"""

import codecs
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import pyarrow as pa
import pyarrow.compute
import pyarrow.csv

from logs.sheet_form import LINE, MISSING, LogError, long_line, opened

UTF8 = ("utf-8", "utf-8-sig")
Judge = Callable[[int, int, str], None]  # row of the block from 1, its cells, its text


def blocks(path: Path, size: int, encoding: str) -> Iterator[bytes]:
    """Whole lines of the first `size` bytes, about a MB at a time, UTF-8 without a mark.

    Raises LogError for a line of more than LINE bytes, UnicodeDecodeError, OSError.
    """
    decoder = None if encoding in UTF8 else codecs.getincrementaldecoder(encoding)()
    rest, first = b"", True
    with opened(path, size) as stream:
        while data := stream.read(LINE):
            if decoder is not None:
                data = decoder.decode(data).encode()
            if first:
                data, first = data.removeprefix(codecs.BOM_UTF8), False
            data = rest + data
            end = 1 + max(data.rfind(b"\n"), data.rfind(b"\r", 0, len(data) - 1))
            if end == 0 and len(data) > LINE:
                raise LogError(
                    f"{path}:{long_line(path, size)}: a line of more than {LINE >> 20} MB; want one"
                    " sample a line"
                )
            rest = data[end:]
            if end:
                yield data[:end]
    if decoder is not None:
        rest += decoder.decode(b"", final=True).encode()
    if rest:
        yield rest


def without_lines(block: bytes, count: int) -> bytes:
    """A block without its first lines."""
    at = 0
    for _ in range(count):
        ends = [end for end in (block.find(b"\n", at), block.find(b"\r", at)) if end >= 0]
        if not ends:
            return b""
        at = min(ends) + (2 if block[min(ends) : min(ends) + 2] == b"\r\n" else 1)
    return block[at:]


def parsed(
    block: bytes,
    names: Sequence[str],
    wanted: Sequence[str],
    separator: str,
    decimal: str,
    judge: Judge,
    times: Mapping[str, str] = MappingProxyType({}),
) -> pa.Table:
    """The wanted ones of the columns `names` of some lines, as numbers; those of `times` (name ->
    iso_time's) are times of day and date and come in s since 1970. `judge` hears of rows of a wrong
    number of cells, which are left out. Raises pa.ArrowInvalid for a cell that is no number.
    """

    def invalid(row: pa.csv.InvalidRow) -> str:
        judge(row.number, row.actual_columns, row.text)
        return "skip"

    memory = pa.allocate_buffer(len(block))
    memoryview(memory).cast("B")[:] = block
    kinds = {name: pa.float64() for name in wanted}
    kinds |= {
        name: pa.timestamp("ns", "UTC" if kind == "Z" else None) for name, kind in times.items()
    }
    table = pa.csv.read_csv(
        pa.BufferReader(memory),
        # as one block: a line is at most as long as all of them
        pa.csv.ReadOptions(use_threads=False, block_size=len(block) + 1, column_names=list(names)),
        pa.csv.ParseOptions(
            delimiter=separator, ignore_empty_lines=False, invalid_row_handler=invalid
        ),
        pa.csv.ConvertOptions(
            column_types=kinds,
            include_columns=list(wanted),
            null_values=MISSING,
            decimal_point=decimal,
        ),
    )
    for name in times:
        place = table.column_names.index(name)
        seconds = pa.compute.divide(
            table[name].cast(pa.int64()).cast(pa.float64(), safe=False), 1e9
        )
        table = table.set_column(place, name, seconds)
    return table
