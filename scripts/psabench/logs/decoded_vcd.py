"""A copy of a recording with decoded rows as variables of type string, and the GTKWave session that shows them on top.

GTKWave 3.3 draws `sTEXT code` as a text and no text as a line in the middle. It ends a text at a space or at a byte
that is not ASCII, and understands \\xHH.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from psabench.link.own import output_text, replace_file
from psabench.logs.annotations import Row, read_rows
from psabench.logs.sessions import DECODED, SESSIONS, decoded_gtkwave_text
from psabench.logs.vcd_span import read_head, span_of
from psabench.logs.viewers import lines_of, scope_of, shipped_folder, window_start_ns

SCOPE = f"$scope module {DECODED} $end\n"


def write_decoded(vcd: Path, for_s: float) -> tuple[Path, Path] | None:
    """FILE.decoded.vcd and, unless it is there, FILE.decoded.gtkw; None where no decoder says anything.

    for_s: how much of the recording is decoded. Raises BadInput, BenchError.
    """
    board = scope_of(vcd)
    if board not in SESSIONS or SCOPE.encode() in read_head(vcd):
        return None
    lines = set(lines_of(vcd))
    stacks = [stack for stack in SESSIONS[board].stacks if lines.issuperset(stack.channels.values())]
    rows = read_rows(vcd, stacks, shipped_folder("decoders"), for_s)
    if not rows:
        return None
    copy, session = vcd.with_suffix(".decoded.vcd"), vcd.with_suffix(".decoded.gtkw")
    with vcd.open(encoding="ascii", errors="replace", newline="") as source, output_text(copy) as file:
        file.writelines(_merge_rows(source, rows))
    if not session.is_file():
        from_ns = window_start_ns(board, span_of(vcd))
        replace_file(session, decoded_gtkwave_text(board, [row.name for row in rows], from_ns))
    return copy, session


def _merge_rows(lines: Iterable[str], rows: Sequence[Row]) -> Iterator[str]:
    """The lines of the recording with the texts of the rows at their instants."""
    codes = [f"~~{n}" for n in range(len(rows))]  # the emulator's have one or two characters
    texts = [(t, _value_line(text, code)) for row, code in zip(rows, codes, strict=True) for t, text in row.changes]
    texts.sort()
    now, done = -1, 0
    for line in lines:
        if line.startswith("$enddefinitions"):
            yield from (SCOPE, *(f"$var string 1 {c} {row.name} $end\n" for row, c in zip(rows, codes, strict=True)))
            yield "$upscope $end\n"
        elif line.startswith("#"):
            t_next = int(line[1:])
            while done < len(texts) and texts[done][0] < t_next:
                t, value = texts[done]
                yield value if t == now else f"#{t}\n{value}"
                now, done = t, done + 1
            now = t_next
        yield line
        if line.startswith("$dumpvars"):
            yield from (_value_line("", code) for code in codes)
    yield from (value for _, value in texts[done:])  # at the last instant


def _value_line(text: str, code: str) -> str:
    escaped = "".join(chr(b) if 0x20 < b < 0x7F and b != 0x5C else f"\\x{b:02x}" for b in text.encode())
    return f"s{escaped} {code}\n"
