"""Session files of the viewers: PulseView's .pvs and GTKWave's .gtkw of each board, from its lines and a table.

`python -m psabench.logs.sessions [FOLDER]` writes them to share/. The form of a .pvs file is that of PulseView 0.4.2;
the channels of a decoder have the names that `sigrok-cli -P DECODER --show` tells. sigrok's own `parallel` is not used:
it asks libsigrokdecode 0.5.3 for each of its channels, and so many questions end in a crash (decoders/psd1cycle/pd.py).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path

from psabench.boards.board import PARALLEL_BUS
from psabench.boards.registry import BOARDS
from psabench.boards.session import Session, Stack
from psabench.link.own import replace_file
from psabench.places import CHECKOUT

NO_MARKERS = " ".join(26 * ["-1"])  # A to Z of GTKWave
DECODED = "decoded"  # scope of the decoded rows in a recording for GTKWave
GTK_ROW_PX, GTK_MARGIN_PX = 21, 130  # of GTKWave 3.3: a row; all that is not rows
SHOWN_LINES = 10  # with the decoded rows as high as the window that PulseView opens, 1000 x 720
FIRST_ROW_PX = (
    -10
)  # in PulseView's view, with a margin above; without it the rows are centred before they have their height
SESSIONS: Mapping[str, Session] = {b.name: b.session for b in BOARDS.values() if b.session is not None}


def pulseview_text(board: str, from_ns: int | None = None) -> str:
    """The .pvs file; from_ns: where the window begins, from the recording's first instant on (the board's)."""
    session = SESSIONS[board]
    begin_ns = session.from_ns if from_ns is None else from_ns
    lines = ["[General]", f"decode_signals={len(session.stacks)}", "generated_signals=0", "views=1", ""]
    for n, stack in enumerate(session.stacks):
        lines += [f"[decode_signal{n}]", *_stack_lines(stack), ""]
    lines += ["[view0]", f"scale={session.scale}", f"v_offset={FIRST_ROW_PX}"]
    # Boost's serialization of a decimal number: digits and exponent of the instant.
    lines.append(f"offset=22 serialization::archive 18 0 0 0 0 {begin_ns // 10} 0 0 0 0 0 -8 0 0 6")
    lines += [f"{line}\\trace_height={session.trace_height}" for line in BOARDS[board].lines]
    shown = shown_lines(board)
    for line in (line for line in BOARDS[board].lines if line not in shown):
        lines += ["", f"[{line}]", f"name={line}", "enabled=false"]
    return "\n".join([*lines, ""])


def shown_lines(board: str) -> list[str]:
    """What PulseView draws: the lines that decoders read, then others, as many as leave room for the decoded rows.

    It puts those below the lines and no session can move them. A parallel bus is the decoder's row.
    """
    read = {line for stack in SESSIONS[board].stacks for line in stack.channels.values()}
    of_bus = set(PARALLEL_BUS) & read
    lines = [line for line in BOARDS[board].lines if line not in of_bus]
    first = sorted(lines, key=lambda line: line not in read)[:SHOWN_LINES]
    return [line for line in lines if line in first]


def _stack_lines(stack: Stack) -> Iterator[str]:
    yield from (f"name={stack.name}", "enabled=true", f"color={stack.color}", f"decoders={len(stack.decoders)}")
    for n, decoder in enumerate(stack.decoders):
        at = f"decoder{n}\\"
        yield from (f"{at}id={decoder.id}", f"{at}visible=true", f"{at}options={len(decoder.options)}")
        for k, (name, value) in enumerate(decoder.options.items()):
            yield f"{at}option{k}\\name={name}"
            yield from (f"{at}option{k}\\{rest}" for rest in _option_lines(value))
        yield from (f"{at}row{row}\\visible=false" for row in decoder.hidden)
    yield f"channels={len(stack.channels)}"
    for n, (name, line) in enumerate(stack.channels.items()):
        at = f"channel{n}\\"
        yield from (f"{at}name={name}", f"{at}initial_pin_state=2", f"{at}assigned_signal_name={line}")


def _option_lines(value: str | int) -> tuple[str, str]:
    """A GVariant: bytes of a text with its end, or of a 64-bit number, in Qt's escapes; and its type."""
    if isinstance(value, str):
        return f'value="@ByteArray({value}\\0)"', "type=s"
    raw = "".join(f"\\x{byte:x}" if byte else "\\0" for byte in value.to_bytes(8, "little"))
    return f'value="@ByteArray({raw})"', "type=x"


def gtkwave_text(board: str, from_ns: int | None = None) -> str:
    """The .gtkw file; from_ns: where the window begins, in the recording's time (the board's)."""
    first, second = SESSIONS[board].comment.split("\n")
    return "\n".join([
        f"[*] GTKWave: gtkwave run.vcd share/{board}.gtkw (or File, Read Save File). {first}",
        f"[*] {second} Times here are nanoseconds.",
        *_gtkwave_window(board, from_ns, SESSIONS[board].gtk_height),
        *_group_lines(board, SESSIONS[board].groups),
        "",
    ])  # fmt: skip


def decoded_gtkwave_text(board: str, rows: Sequence[str], from_ns: int | None = None) -> str:
    """The .gtkw file of a recording with decoded rows (logs/decoded_vcd.py): those first, then the lines.

    A parallel bus is a row for its address and a row for its data. The window is as high as the rows.
    """
    shown = ["@28", *(f"{DECODED}.{row}" for row in rows)]
    for names in SESSIONS[board].groups.values():
        shown += ["@200", "-"]
        for name in names.split():
            shown += _bus_lines(board) if name == "*" else ["@28", f"{board}.{name}"]
    drawn = sum(not line.startswith("@") for line in shown)
    height = max(SESSIONS[board].gtk_height, GTK_MARGIN_PX + GTK_ROW_PX * drawn)
    return "\n".join([*_gtkwave_window(board, from_ns, height), "[sst_expanded] 0", *shown, ""])


def _bus_lines(board: str) -> Iterator[str]:
    """CS, RW, AB[3:0], D[15:0]; vectors in hexadecimal."""
    for stem, numbered in groupby(PARALLEL_BUS, lambda line: line.rstrip("0123456789")):
        lines = [f"{board}.{line}" for line in numbered]
        if len(lines) > 1:
            yield from ("@22", f"#{{{stem}[{len(lines) - 1}:0]}} {' '.join(reversed(lines))}")
        else:
            yield from ("@28", *lines)


def _gtkwave_window(board: str, from_ns: int | None, height: int) -> Iterator[str]:
    session = SESSIONS[board]
    begin_ns, cursor_ns = (session.gtk_from_ns, session.gtk_cursor_ns) if from_ns is None else (from_ns, from_ns)
    yield from (f"[timestart] {begin_ns}", f"[size] 1400 {height}", "[pos] -1 -1")
    yield f"*-15.000000 {cursor_ns} {NO_MARKERS}"


def _group_lines(board: str, groups: Mapping[str, str]) -> Iterator[str]:
    for heading, names in groups.items():
        yield from ("@200", f"-{heading}", "@28")
        for name in names.split():
            yield from (f"{board}.{line}" for line in (PARALLEL_BUS if name == "*" else (name,)))


def session_texts() -> dict[str, str]:
    """Every file, by its name."""
    endings = {".gtkw": gtkwave_text, ".pvs": pulseview_text}
    return {f"{board}{ending}": text(board) for board in SESSIONS for ending, text in endings.items()}


def main(argv: Sequence[str] | None = None) -> int:
    """Writes the files."""
    args = list(sys.argv[1:] if argv is None else argv)
    folder = Path(args[0]) if args else CHECKOUT / "share"
    for name, text in session_texts().items():
        replace_file(folder / name, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
