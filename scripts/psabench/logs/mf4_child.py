"""In the process of its own that writes an MF4 file: asammdf is loaded here and nowhere else."""

from __future__ import annotations

import errno
import json
import math
import os
import resource
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

import can
import numpy as np
from can.io import mf4 as python_can_mf4

from psabench.conform.sources import mf4
from psabench.link import signals
from psabench.link.protocol_files import message
from psabench.logs.records import Decoder, frame_of

MOST_CPU_S = 600
asammdf: Any = python_can_mf4  # which loads it; loaded before python-can, it would load python-can half


def main(path: str, boards: str) -> None:
    """Frames on stdin as lines of JSON; prints how many are in the file. Ends the process at once."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    mf4.limit(resource.RLIMIT_AS, mf4.MOST_MEMORY)
    mf4.limit(resource.RLIMIT_CPU, MOST_CPU_S + round(used.ru_utime + used.ru_stime) + 1)
    mf4.limit(resource.RLIMIT_CORE, 0)
    out, sys.stdout = sys.stdout, sys.stderr
    try:
        frames = read_spool(sys.stdin.buffer)
        write(Path(path), frames, {int(node): board for node, board in json.loads(boards).items()})
        print(len(frames), file=out, flush=True)
    except OSError as e:
        print(f"{e.errno} {e.strerror}", file=sys.stderr, flush=True)
        os._exit(1)
    except Exception as e:  # asammdf raises whatever its writing comes to
        print(f"{type(e).__name__}: {' '.join(str(e).split())}", file=sys.stderr, flush=True)
        os._exit(1)
    os._exit(0)


def read_spool(lines: IO[bytes]) -> list[can.Message]:
    """A last line may be cut: the disk was full."""
    return [frame_of(json.loads(line)) for line in lines if line.endswith(b"\n")]


def write(path: Path, frames: Sequence[can.Message], boards: Mapping[int, str]) -> None:
    """With the decoded channels, or the frames alone where these do not fit on the disk. Raises OSError."""
    try:
        _write_file(path, frames, Decoder(boards))
    except OSError as e:
        if e.errno not in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT):
            raise
        os.truncate(path, 0)
        _write_file(path, frames, None)


def _write_file(path: Path, frames: Sequence[can.Message], decoder: Decoder | None) -> None:
    stamps = np.maximum.accumulate(np.array([m.timestamp for m in frames], dtype=np.float64))
    start_s = math.floor(stamps[0]) if len(stamps) else 0
    t_s = stamps - start_s
    mdf = asammdf.MDF(version="4.10")
    mdf.header.start_time = datetime.fromtimestamp(start_s, tz=UTC)
    kinds = np.array([1 if m.is_error_frame else 2 if m.is_remote_frame else 0 for m in frames], dtype=np.int64)
    bus = asammdf.SourceInformation(source_type=asammdf.SOURCE_BUS, bus_type=asammdf.BUS_TYPE_CAN)
    names = ("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame")
    types = (asammdf.STD_DTYPE, asammdf.ERR_DTYPE, asammdf.RTR_DTYPE)
    for kind, (name, dtype) in enumerate(zip(names, types, strict=True)):
        where = np.flatnonzero(kinds == kind)
        rows = np.zeros(len(where), dtype=dtype)
        for row, k in enumerate(where.tolist()):
            _fill_row(rows[row : row + 1], name, frames[k])
        mdf.append(asammdf.Signal(name=name, samples=rows, timestamps=t_s[where], source=bus))
    if decoder:
        _append_decoded(mdf, frames, t_s, decoder)
    with path.open("r+b") as file:
        mdf.save(file, compression=2)
    mdf.close()


def _fill_row(row: Any, name: str, m: can.Message) -> None:
    """One row of python-can's types."""
    values: dict[str, Any] = {
        "BusChannel": can.util.channel2int(m.channel) or 0,
        "ID": m.arbitration_id,
        "IDE": int(m.is_extended_id),
        "DLC": can.util.len2dlc(m.dlc) if m.is_fd else m.dlc,
        "DataLength": len(m.data),
        "Dir": 0 if m.is_rx else 1,
        "EDL": int(m.is_fd),
        "BRS": int(m.is_fd and m.bitrate_switch),
        "ESI": int(m.is_fd and m.error_state_indicator),
    }
    for field in row.dtype.names:
        key = field.removeprefix(f"{name}.")
        if key == "DataBytes":
            row[field][0, : len(m.data)] = m.data
        elif key in values:
            row[field] = values[key]


def _append_decoded(mdf: Any, frames: Sequence[can.Message], t_s: signals.Floats, decoder: Decoder) -> None:
    """A group of each message: raw integers, whose conversion gives the unit of the DBC."""
    where: dict[tuple[str, str], list[int]] = {}
    for k, m in enumerate(frames):
        topic, name = decoder.topic(m)
        if name and len(m.data) >= message(name).length:
            where.setdefault((topic, name), []).append(k)
    for (topic, name), rows in sorted(where.items()):
        length = int(message(name).length)
        bits = signals.payload([bytes(frames[k].data[:length]) for k in rows], length)
        group = [
            _signal_channel(f"{topic.strip('/').replace('/', '.')}.{signal}", s, signals.raw(bits, s), t_s[rows])
            for signal, s in signals.layout(message(name)).items()
        ]
        mdf.append(group, acq_name=topic.strip("/"), comment=message(name).comment or "")


def _signal_channel(name: str, s: signals.Signal, samples: signals.Ints, t_s: signals.Floats) -> Any:
    linear = {"a": s.scale, "b": s.offset}
    return asammdf.Signal(
        name=name,
        samples=samples,
        timestamps=t_s,
        unit=s.unit,
        conversion=None if (s.scale, s.offset) == (1, 0) else linear,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
