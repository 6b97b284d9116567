"""Session files of the viewers: PulseView's .pvs and GTKWave's .gtkw of each board, from its lines and a table.

`python -m psabench.logs.sessions [FOLDER]` writes them to share/. The form of a .pvs file is that of PulseView 0.4.2;
the channels of a decoder have the names that `sigrok-cli -P DECODER --show` tells. sigrok's own `parallel` is not used:
it asks libsigrokdecode 0.5.3 for each of its channels, and so many questions end in a crash (decoders/psd1cycle/pd.py).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from psabench.boards.board import PARALLEL_BUS
from psabench.boards.registry import BOARDS
from psabench.link.own import replace_file
from psabench.places import CHECKOUT

GREEN, PURPLE, ORANGE = 0xFF32AA32, 0xFF8232AA, 0xFF8F5202  # alpha, red, green, blue
NO_MARKERS = " ".join(26 * ["-1"])  # A to Z of GTKWave


@dataclass(frozen=True, slots=True)
class Decoder:
    """A decoder of sigrok with what differs from its defaults; hidden: rows that are not shown."""

    id: str
    options: Mapping[str, str | int] = field(default_factory=dict)
    hidden: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Stack:
    """Decoders on top of each other, and the lines of the lowest one's channels, by their names."""

    name: str
    color: int
    decoders: tuple[Decoder, ...]
    channels: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """What the viewers of a board's recording show at first."""

    stacks: tuple[Stack, ...]
    from_ns: int  # where PulseView's window begins: a multiple of 10 ns
    scale: str  # seconds a pixel of it
    trace_height: int = 18
    comment: str  # of GTKWave, in two lines
    gtk_from_ns: int
    gtk_cursor_ns: int
    gtk_height: int = 760
    groups: Mapping[str, str]  # lines under a heading; "*": those of the parallel bus


def spi(*, miso: str, mosi: str, above: Decoder, options: Mapping[str, str | int], name: str, color: int) -> Stack:
    """A converter of PSA-2. SClk is for the accelerometer converters while CST is high."""
    lowest = Decoder("spi", options, hidden=(0, 2, 3, 5, 6))
    return Stack(name, color, (lowest, above), {"CLK": "SClk", "MISO": miso, "MOSI": mosi, "CS#": "CST"})


def period(name: str, color: int, line: str) -> Stack:
    """The time from each rise of a line to the next."""
    return Stack(name, color, (Decoder("timing", {"edge": "rising"}, hidden=(1, 2)),), {"Data": line})


BUS = Stack("Bus", PURPLE, (Decoder("psabus"),), {line: line for line in PARALLEL_BUS})
PULSES = ("FXP", "FXN", "FYP", "FYN", "FZP", "FZN")
CYCLE_LINES = ("A0", "RFX", "RFY", "RFZ", "SCLK", "SDAT", "FL2", *PARALLEL_BUS)

SESSIONS: Mapping[str, Session] = {
    "psa2": Session(
        stacks=(
            Stack("Frame", GREEN, (Decoder("psa2frame", hidden=(0,)),), {"INT": "Int", "DATA": "Data", "CLK": "CLK"}),
            spi(
                name="Accelerometers",
                color=PURPLE,
                miso="DOutX",
                mosi="DIn",
                options={"cs_polarity": "active-high"},
                above=Decoder("ads128x"),
            ),
            spi(
                name="Temperature",
                color=ORANGE,
                miso="DOutT",
                mosi="DInT",
                options={"cpha": 1},
                above=Decoder("ads1256"),
            ),
        ),
        from_ns=63_090_000,
        scale="1.5e-07",
        comment="Opens on the set-up after Res; the lines carry the\nnames of the article's table.",
        gtk_from_ns=63_100_000,
        gtk_cursor_ns=63_106_440,
        groups={
            "Reset and synchronisation": "Res SYNC_A SYNC_T",
            "Serial ports of the converters": "DRD_A DRD_T SClk DIn DOutX DOutY DOutZ CST DInT DOutT",
            "To the navigation computer": "Int Data CLK",
        },
    ),
    "psd1": Session(
        stacks=(Stack("Cycle", GREEN, (Decoder("psd1cycle", hidden=(0,)),), {line: line for line in CYCLE_LINES}),),
        from_ns=9_880_000,
        scale="5e-08",
        trace_height=14,
        comment="Opens on the second cycle of reading; the lines carry\nthe names of the article.",
        gtk_from_ns=9_880_000,
        gtk_cursor_ns=9_882_400,
        gtk_height=860,
        groups={
            "Conditions of a cycle": "CLK_1M25 INT0 FL1 DR",
            "Converters": "A0 RFX RFY RFZ TFS SCLK SDAT",
            "To the navigation computer": "FL2 *",
        },
    ),
    "pmka": Session(
        stacks=(period("Samples", GREEN, "SH"), BUS),
        from_ns=9_500_000,
        scale="2e-05",
        trace_height=14,
        comment="Opens on the first periods; the lines carry\nthe names of docs/boards/pmka.md.",
        gtk_from_ns=9_500_000,
        gtk_cursor_ns=10_000_000,
        gtk_height=1000,
        groups={
            "Keys and beat": "KL1 KL2 KL3 KL4 TAU0 TAU1 TAU2",
            "Precision resets": "RP1 RN1 RP2 RN2 RP3 RN3 RP4 RN4",
            "Sample and conversion": "SH CONV MUX0 MUX1",
            "Parallel bus": "*",
        },
    ),
    "pik": Session(
        stacks=(
            *(
                Stack(
                    f"Count {line}",
                    GREEN,
                    (Decoder("counter", {"data_edge": "rising"}, hidden=(1, 2)),),
                    {"Data": line, "Reset": "LATCH"},
                )
                for line in PULSES
            ),
            period("Latch", ORANGE, "LATCH"),
            BUS,
        ),
        from_ns=9_500_000,
        scale="2e-05",
        trace_height=14,
        comment="Opens on the first latch of the counters; the lines\ncarry the names of docs/boards/pik.md.",
        gtk_from_ns=9_500_000,
        gtk_cursor_ns=10_000_000,
        gtk_height=860,
        groups={"Resets": f"CLK {' '.join(PULSES)}", "Counters": "LATCH", "Parallel bus": "*"},
    ),
    "gyro": Session(
        stacks=(period("Steps", GREEN, "STEP"),),
        from_ns=195_000_000,
        scale="2e-04",
        comment="Opens on the first steps; the lines carry\nthe names of docs/boards/gyro.md.",
        gtk_from_ns=195_000_000,
        gtk_cursor_ns=200_000_000,
        groups={"Control loops": "STEP READY FAULT", "Gyrocompassing": "SLEW SETTLE WINDOW"},
    ),
}


def pulseview_text(board: str) -> str:
    """The .pvs file."""
    session = SESSIONS[board]
    lines = ["[General]", f"decode_signals={len(session.stacks)}", "generated_signals=0", "views=1", ""]
    for n, stack in enumerate(session.stacks):
        lines += [f"[decode_signal{n}]", *_stack_lines(stack), ""]
    lines += ["[view0]", f"scale={session.scale}"]
    # Boost's serialization of a decimal number: digits and exponent of the instant.
    lines.append(f"offset=22 serialization::archive 18 0 0 0 0 {session.from_ns // 10} 0 0 0 0 0 -8 0 0 6")
    lines += [f"{line}\\trace_height={session.trace_height}" for line in BOARDS[board].lines]
    return "\n".join([*lines, ""])


def _stack_lines(stack: Stack) -> Iterator[str]:
    yield from (f"name={stack.name}", "enabled=true", f"color={stack.color}", f"decoders={len(stack.decoders)}")
    for n, decoder in enumerate(stack.decoders):
        at = f"decoder{n}\\"
        yield from (f"{at}id={decoder.id}", f"{at}visible=true", f"{at}options={len(decoder.options)}")
        for k, (name, value) in enumerate(decoder.options.items()):
            yield f"{at}option{k}\\name={name}"
            yield from (f"{at}option{k}\\{rest}" for rest in _option(value))
        yield from (f"{at}row{row}\\visible=false" for row in decoder.hidden)
    yield f"channels={len(stack.channels)}"
    for n, (name, line) in enumerate(stack.channels.items()):
        at = f"channel{n}\\"
        yield from (f"{at}name={name}", f"{at}initial_pin_state=2", f"{at}assigned_signal_name={line}")


def _option(value: str | int) -> tuple[str, str]:
    """A GVariant: bytes of a text with its end, or of a 64-bit number, in Qt's escapes; and its type."""
    if isinstance(value, str):
        return f'value="@ByteArray({value}\\0)"', "type=s"
    raw = "".join(f"\\x{byte:x}" if byte else "\\0" for byte in value.to_bytes(8, "little"))
    return f'value="@ByteArray({raw})"', "type=x"


def gtkwave_text(board: str) -> str:
    """The .gtkw file."""
    session = SESSIONS[board]
    first, second = session.comment.split("\n")
    return "\n".join([
        f"[*] GTKWave: gtkwave run.vcd share/{board}.gtkw (or File, Read Save File). {first}",
        f"[*] {second} Times here are nanoseconds.",
        f"[timestart] {session.gtk_from_ns}",
        f"[size] 1400 {session.gtk_height}",
        "[pos] -1 -1",
        f"*-15.000000 {session.gtk_cursor_ns} {NO_MARKERS}",
        *_group_lines(board, session.groups),
        "",
    ])  # fmt: skip


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
