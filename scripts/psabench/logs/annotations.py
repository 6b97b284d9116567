"""What the sigrok decoders of a session say of a recording: sigrok-cli runs the stacks that PulseView runs, together.

The libsigrok of Debian 12 reads a sample for each unit of the file's time, so a second of a PSA-2 takes about three
seconds of a processor for each stack.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

from psabench.boards.session import Decoder, Stack
from psabench.errors import BenchError, expected
from psabench.logs.vcd_span import TIME, span_of, unit_fs

_FS_PER_NS, _FS_PER_US, _NS_PER_S = 10**6, 10**9, 10**9
# --protocol-decoder-jsontrace, a line each; sigrok-cli 0.7.2 does not escape the text.
_EVENT = re.compile(r'\{"ph": "(.)", "ts": ([\d.]+), "pid": "(.*?)-\d+", "tid": "(.*?)", "name": "(.*)"\}')
_NAMED = re.compile(r"^- (\S+) \(([^)]*)\): ", re.MULTILINE)

Change = tuple[int, str]  # instant in units of the file, the text from then on
_Span = tuple[int, int, str]


@dataclass(frozen=True, slots=True)
class Row:
    """A row of annotations: a name of letters, digits and _, and its texts in order of time; "" between them."""

    name: str
    changes: Sequence[Change]


def read_rows(vcd: Path, stacks: Sequence[Stack], decoders: Path, for_s: float) -> list[Row]:
    """The rows that a session shows and that say something, in its order. Raises BadInput, BenchError.

    for_s: how much of the recording is decoded, from its first instant on; the rows say where that ends.
    """
    span, unit = span_of(vcd), unit_fs(vcd)
    first, last = (t_ns * _FS_PER_NS // unit for t_ns in (span.start_ns, span.end_ns))
    limit = first + round(for_s * _NS_PER_S) * _FS_PER_NS // unit
    with TemporaryDirectory() as name:
        folder = Path(name)
        part = vcd if last <= limit else _copy_until(limit, vcd, folder / "part.vcd")
        texts = _run_sigrok(part, stacks, decoders, folder)
    rows: list[Row] = []
    for stack, text in zip(stacks, texts, strict=True):
        spans = _spans_of(text, first, unit)
        for key in ((d.id, row) for d in stack.decoders for _, row in _rows_of(d, decoders)):
            if key in spans:
                name = re.sub(r"\W+", "_", f"{stack.name} {key[1]}")
                end = [] if part is vcd else [(limit, f"not decoded after {for_s:g} s (--decode)")]
                rows.append(Row(name, [*_changes_of(spans[key]), *end]))
    return rows


def _copy_until(limit: int, vcd: Path, part: Path) -> Path:
    """The recording up to an instant, in units of the file."""
    with vcd.open("rb") as source, part.open("wb") as file:
        for line in source:
            if (m := TIME.match(line)) and int(m[1]) > limit:
                break
            file.write(line)
        file.write(b"#%d\n" % limit)
    return part


def _run_sigrok(vcd: Path, stacks: Sequence[Stack], decoders: Path, folder: Path) -> list[str]:
    """Standard output for each stack; files, so that no process waits for its reader. Raises BenchError."""
    outputs = [folder / f"{n}.json" for n in range(len(stacks))]
    running = []
    try:
        for stack, output in zip(stacks, outputs, strict=True):
            words = ["-i", str(vcd), "-I", "vcd", *_words_of(stack, decoders), "--protocol-decoder-jsontrace"]
            with output.open("wb") as file:
                running.append(_start_sigrok(words, decoders, file))
        for process in running:
            _wait_for(process)
    finally:
        for process in running:
            process.kill()
            process.wait()
    return [output.read_text(encoding="utf-8", errors="replace") for output in outputs]


def _start_sigrok(words: Sequence[str], decoders: Path, stdout: BinaryIO | int) -> subprocess.Popen[bytes]:
    env = {**os.environ, "SIGROKDECODE_DIR": str(decoders)}
    return subprocess.Popen(["sigrok-cli", *words], env=env, stdout=stdout, stderr=subprocess.PIPE)


def _wait_for(process: subprocess.Popen[bytes]) -> str:
    """Its standard output, if that is a pipe. Raises BenchError."""
    output, error = (text.decode(errors="replace") if text else "" for text in process.communicate())
    if process.returncode:
        got = "; ".join([str(process.returncode), *error.strip().splitlines()[:1]])
        raise BenchError(expected("exit status 0", got, "sigrok-cli"))
    return output


def _words_of(stack: Stack, decoders: Path) -> list[str]:
    """-P and -A of sigrok-cli: decoders with lines and options, and the rows that are not hidden."""
    ids = {name: channel for channel, name in _NAMED.findall(_show_decoder(stack.decoders[0].id, decoders)[1])}
    lines = [f"{ids[channel]}={line}" for channel, line in stack.channels.items()]
    words, shown = [], []
    for n, decoder in enumerate(stack.decoders):
        options = [f"{name}={value}" for name, value in decoder.options.items()]
        words.append(":".join([decoder.id, *([] if n else lines), *options]))
        shown.append(f"{decoder.id}={':'.join(row for row, _ in _rows_of(decoder, decoders))}")
    return ["-P", ",".join(words), "-A", ",".join(shown)]


def _rows_of(decoder: Decoder, decoders: Path) -> list[tuple[str, str]]:
    """Id and name of each row of a decoder that the session does not hide."""
    rows = _NAMED.findall(_show_decoder(decoder.id, decoders)[0])
    return [row for n, row in enumerate(rows) if n not in decoder.hidden]


@cache
def _show_decoder(decoder: str, decoders: Path) -> tuple[str, str]:
    """What sigrok-cli says of a decoder: its rows; its channels. Raises BenchError."""
    text = _wait_for(_start_sigrok(["-P", decoder, "--show"], decoders, subprocess.PIPE))
    rows = text.partition("Annotation rows:")[2].partition("Binary classes:")[0]
    return rows, text.partition("Required channels:")[2]


def _spans_of(text: str, first: int, unit: int) -> dict[tuple[str, str], list[_Span]]:
    """By decoder and row: first and last instant of each annotation in units of the file, and its text."""
    spans: dict[tuple[str, str], list[_Span]] = defaultdict(list)
    for begin, end in pairwise(_EVENT.finditer(text)):
        if begin[1] == "B":
            since, until = (first + round(float(event[2]) * _FS_PER_US / unit) for event in (begin, end))
            spans[begin[3], begin[4]].append((since, until, begin[5]))
    return spans


def _changes_of(spans: Sequence[_Span]) -> list[Change]:
    """Texts that begin together are one; a later text takes the place of one that has not ended."""
    at: dict[int, tuple[int, list[str]]] = {}
    for since, until, text in sorted(spans, key=lambda span: span[0]):
        end, texts = at.get(since, (since + 1, []))
        at[since] = max(end, until), [*texts, text]
    changes: list[Change] = []
    for since, (end, texts) in at.items():
        if changes and changes[-1][0] >= since:
            del changes[-1]  # the empty text of what has not ended, or ends now
        changes += [(since, "; ".join(texts)), (end, "")]
    return changes
