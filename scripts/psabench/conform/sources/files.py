"""Files to one recording: at most one log of the CAN bus, at most one recording of lines."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from psabench.conform.capture.log import CanLog
from psabench.conform.sources import can_logs
from psabench.conform.sources.lines import Recorded, log_of
from psabench.conform.sources.sampled import read_samples
from psabench.conform.sources.samples import PORT_LINES
from psabench.conform.sources.sigrok import read_sr
from psabench.conform.sources.taken import BLOCK, NS, Bounds, CanTake, LineTake
from psabench.conform.sources.vcd_file import read_vcd_file
from psabench.errors import BadInput, check_there, expected, input_error

CAN_ENDINGS = can_logs.ENDINGS
LINE_ENDINGS = (".vcd", ".sr", ".bin")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """What the files hold. can, lines: None where no file has such. files: what each was, for the report."""

    can: CanLog | None
    lines: Recorded | None
    files: Mapping[str, str]  # path: SHA-256, what was read, where it ended
    notes: Sequence[str]  # files that were not checked to their end


def read_files(paths: Sequence[Path], family: str, told: Mapping[str, str], bounds: Bounds) -> Recording:
    """Raises BadInput with file and place for what cannot be used."""
    can = lines = None
    files: dict[str, str] = {}
    notes = []
    for path in paths:
        take = _read(path, family, bounds)
        if isinstance(take, CanTake):
            _one(path, can, "log of the CAN bus")
            can, what = CanLog(frames=take.frames), _span_of_can(take)
        else:
            _one(path, lines, "recording of lines")
            lines = log_of(take, family, told, str(path))
            what = _span_of_lines(take, lines)
        files[str(path)] = f"{what}; SHA-256 {_sha256(path)}" + (f"; {take.note}" if take.note else "")
        notes += [f"{path}: {take.note}"] if take.note else []
    if told and lines is None:
        raise BadInput(expected("a recording of lines (.vcd, .sr, .bin)", "none", "--line"))
    return Recording(can=can, lines=lines, files=files, notes=notes)


def _read(path: Path, family: str, bounds: Bounds) -> CanTake | LineTake:
    ending = path.suffix.lower()
    if ending not in CAN_ENDINGS + LINE_ENDINGS:
        raise BadInput(expected(f"an ending of {' '.join(CAN_ENDINGS + LINE_ENDINGS)}", ending or "none", path))
    check_there(path, "a recording")
    try:
        if ending == ".vcd":
            return read_vcd_file(path, bounds)
        if ending == ".sr":
            return read_sr(path, bounds)
        return read_samples(path, PORT_LINES[family], bounds) if ending == ".bin" else can_logs.read_can(path, bounds)
    except OSError as e:
        raise input_error(path, "a recording", e) from e


def _one(path: Path, before: object, what: str) -> None:
    if before is not None:
        raise BadInput(expected(f"one {what}", "a second", path))


def _span_of_can(take: CanTake) -> str:
    first_s, last_s = take.frames[0].t_s, take.frames[-1].t_s
    return f"{len(take.frames)} CAN frames, {first_s:.6f} to {last_s:.6f} s"


def _span_of_lines(take: LineTake, log: Recorded) -> str:
    gaps = f", {len(take.gaps_ns)} gaps" if len(take.gaps_ns) else ""
    return (
        f"{', '.join(log.recording.wires)}: {take.start_ns / NS:.6f} to {take.end_ns / NS:.6f} s, "
        f"edges known to {take.resolution_ns:.4g} ns{gaps}"
    )


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while data := file.read(BLOCK):
            digest.update(data)
    return digest.hexdigest()
