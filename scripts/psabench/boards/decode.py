"""`psabench decode`: a CAN log (any format of psabench.logs) or a line-port capture into a CSV of SI values."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from psabench.boards.devices import of_board, reader_of
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import SAMPLE_MESSAGES, FrameReader, Frames
from psabench.boards.readings import ReadingReader, Readings
from psabench.errors import BadInput, check_there, expected, input_error
from psabench.link import lineport
from psabench.link.lineport import LineDecoder, LineFormat, decode_stream
from psabench.link.protocol_files import dbc_node, message
from psabench.logs.formats import check_readable, read_frames
from psabench.output import json_line

TEMP_DECIMALS = 3  # a code is 15 mK
CHUNK = 4096  # samples decoded at once

COUNTED = ("", "LSB", "counts", "pulses")  # units of columns that are whole numbers

Table = Mapping[str, np.ndarray[Any, np.dtype[Any]]]  # columns by what the CSV calls them


Row = tuple[Any, ...]
WriteTable = Callable[[Sequence[str], Sequence[Row], bool], None]  # names of columns, rows, whether they are the first
Form = Callable[[IO[str]], WriteTable]


def csv_table(out: IO[str]) -> WriteTable:
    """Names of columns before the first row."""
    csv_file = csv.writer(out, lineterminator="\n")

    def write_rows(names: Sequence[str], rows: Sequence[Row], first: bool) -> None:
        csv_file.writerows([names, *rows] if first else rows)

    return write_rows


def json_table(out: IO[str]) -> WriteTable:
    """An object a row: its keys are the names of the columns."""

    def write_rows(names: Sequence[str], rows: Sequence[Row], first: bool) -> None:
        out.writelines(f"{json_line(dict(zip(names, row, strict=True)))}\n" for row in rows)

    return write_rows


def decode_can(
    path: Path,
    node: int,
    out: IO[str],
    board: str = "psa2",
    more: Callable[[Frames], Table] | None = None,
    table: Form = csv_table,
) -> FrameReader | ReadingReader:
    """Frames (of other boards: readings) of one node from a log. Nothing is written before the first.

    more: further columns of frames. table: form of the rows in `out`.

    Raises BadInput for a file that cannot be read, with what was wrong and where, and for one without a frame of that
    node, with the nodes whose frames it has.
    """
    check_readable(path)
    reader, ids = reader_of(board, node), set[int]()
    chunks = _chunks(path, reader, ids)
    if not _write(table(out), (_of_frames(f, more) if isinstance(f, Frames) else _of_readings(f) for f in chunks)):
        raise BadInput(expected(f"frames of node {node}", _no_frame(node, senders_of(ids, board)), path))
    return reader


def _no_frame(node: int, senders: set[int]) -> str:
    others = ", ".join(map(str, sorted(senders - {node}))) or "none"
    what = "only parts of them; other nodes" if node in senders else "none; nodes"
    return f"{what} with frames: {others}"


def senders_of(ids: set[int], board: str) -> set[int]:
    """Nodes whose samples these identifiers announce, if they are such boards'."""
    names = SAMPLE_MESSAGES if of_board(board) is Psa2 else of_board(board).layout.messages
    bases = [int(message(name).frame_id) - dbc_node(of_board(board).board) for name in names]
    return {i - base for i in ids for base in bases if 1 <= i - base <= 127}


def _chunks(path: Path, reader: FrameReader | ReadingReader, ids: set[int]) -> Iterator[Frames | Readings]:
    """Frames of the reader's node, some at a time; `ids` collects the 11-bit identifiers of all data frames."""
    try:
        for m in read_frames(path):
            reader.on_message(m)
            if not (m.is_extended_id or m.is_error_frame or m.is_remote_frame):
                ids.add(m.arbitration_id)
            if len(reader) >= CHUNK:
                yield reader.take()
    except BadInput:
        yield reader.take()  # what came before the damage is good
        raise
    yield reader.take()


def _of_frames(f: Frames, more: Callable[[Frames], Table] | None) -> Table:
    x_v, y_v, z_v = f.u_v.T
    columns = {
        "t_rx_s": f.t_rx_s,
        "t_sample_s": f.t_sample_s,
        "x_v": x_v,
        "y_v": y_v,
        "z_v": z_v,
        "temp_code": f.temp_code,
        "temp_channel": f.temp_channel,
        "settled": f.settled.astype(int),
        "clipped": f.clipped.astype(int),
        "temp_degc": np.round(f.temp_degc, TEMP_DECIMALS),
    }
    return columns | dict(more(f)) if more else columns


def _of_readings(r: Readings) -> Table:
    """Names with their units: X_LSB, T_degC; bare where a signal is a number or a bit."""
    columns = {"t_rx_s": r.t_rx_s, "t_sample_s": r.t_sample_s}
    for name, c in r.columns.items():
        unit = r.units[name]
        columns["_".join(filter(None, (name, unit)))] = c.astype(np.int64) if unit in COUNTED else c
    return columns


def _write(out: WriteTable, tables: Iterable[Table]) -> bool:
    """Tables with the same columns; whether there was a row."""
    begun = False
    for table in tables:
        rows = list(zip(*(c.tolist() for c in table.values()), strict=True))
        if rows:
            out(list(table), rows, not begun)
            begun = True
    return begun


def decode_line(path: Path, fmt: LineFormat, out: IO[str], table: Form = csv_table) -> LineDecoder:
    """Frames of a capture of INT/DATA/CLK samples. Raises BadInput when the file cannot be opened or has no frame.

    Nothing is written before the first frame.
    """
    decoder = LineDecoder(fmt)
    check_there(path, "a capture of a line port")
    try:
        stream = path.open("rb")
    except OSError as e:
        raise input_error(path, "a capture of a line port", e) from e
    with stream:
        begun = _write(table(out), (_of_line(f, fmt) for f in decode_stream(stream, decoder)))
    if not begun:
        raise BadInput(expected(f"frames of {fmt.word_bits}-bit words", f"none ({decoder.counts})", path))
    return decoder


def _of_line(f: lineport.Frames, fmt: LineFormat) -> Table:
    words = {f"word{k}": word for k, word in enumerate(f.words.T)}
    return {"t_int_fall_s": f.fall / fmt.sample_hz, "t_int_rise_s": f.rise / fmt.sample_hz, **words}
