"""`psabench waveform`: what PulseView and GTKWave load beside a VCD file, and the sigrok decoders in their folder."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from psabench.errors import BadInput, check_there, expected, output_error
from psabench.link.own import replace_file
from psabench.logs.sessions import SESSIONS, gtkwave_text, pulseview_text
from psabench.logs.vcd_span import Span, read_head, span_of
from psabench.options import Parser
from psabench.output import add_json, show_data
from psabench.places import BUNDLE, CHECKOUT, no_package
from psabench.shell.units import number

EPILOG = """\
examples:
  psabench waveform run.vcd              writes run.gtkw and run.pvs beside it
  psabench waveform run.vcd --from 9.878ms --to 9.9ms --lines A0,RFX,SCLK,SDAT,D --wavedrom cycle.json --svg cycle.svg
                                         a window as a WaveDrom timing picture and as a picture of our own
  psabench waveform --decoders           installs the sigrok decoders for this user
  psabench waveform --wireshark          installs Wireshark's dissectors for this user

PulseView loads the .pvs file by itself; GTKWave: gtkwave run.vcd run.gtkw.
"""
NS_PER_S = 10**9
SCOPE = re.compile(rb"\$scope\s+module\s+(\w+)\s+\$end")
LINE = re.compile(rb"\$var\s+wire\s+1\s+\S+\s+(\w+)\s+\$end")


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench waveform`. Raises BadInput."""
    p = Parser(prog="psabench waveform", description="Write viewer files, install decoders.", epilog=EPILOG)
    p.set_defaults(handler=_run_waveform)
    p.add_argument("file", type=Path, nargs="?", help="VCD file of psa-emu --vcd")
    both = p.add_mutually_exclusive_group()
    both.add_argument(
        "--decoders", action="store_true", help=f"copy the sigrok decoders into FOLDER ({user_decoders()})"
    )
    both.add_argument("--wireshark", action="store_true", help=f"the dissectors into FOLDER ({user_plugins()})")
    p.add_argument("--dir", type=Path, metavar="FOLDER", help="another folder")
    window = p.add_argument_group("a window of FILE, as a picture")
    window.add_argument("--wavedrom", type=Path, metavar="OUT", help="WaveDrom JSON, a column a tick")
    window.add_argument("--svg", type=Path, metavar="OUT", help="SVG")
    window.add_argument(
        "--from", dest="from_ns", type=_time_ns, metavar="TIME", help="such as 9.878ms (the first instant)"
    )
    window.add_argument("--to", dest="to_ns", type=_time_ns, metavar="TIME", help="(the last instant)")
    window.add_argument("--lines", metavar="NAMES", help="such as Int,Data,CLK; D for D0, D1 ... as a number (all)")
    tick = "length of a column (the longest that shows every edge)"
    window.add_argument("--tick", dest="tick_ns", type=_time_ns, default=0, metavar="TIME", help=tick)
    window.add_argument("--title", default="", help="(name of FILE)")
    add_json(p)
    return p.parse_args(words)


def _time_ns(text: str) -> int:
    """Nanoseconds of a time such as 5ms."""
    try:
        return round(number(text, "s") * NS_PER_S)
    except (ValueError, OverflowError) as e:
        raise argparse.ArgumentTypeError(str(e)) from e


def user_decoders() -> Path:
    """Where sigrok looks for a user's decoders."""
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share"
    return Path(data) / "libsigrokdecode/decoders"


def user_plugins() -> Path:
    """Where Wireshark looks for a user's Lua plugins (tshark -G folders)."""
    return Path.home() / ".local/lib/wireshark/plugins"


def _run_waveform(args: argparse.Namespace) -> int:
    pictures = args.wavedrom or args.svg
    installs = args.decoders or args.wireshark
    if args.file is None and (pictures or not installs):
        what = "a VCD file" if pictures else "a VCD file, --decoders or --wireshark"
        raise BadInput(expected(what, "none", "waveform"))
    written = write_pictures(args) if pictures else write_sessions(args.file) if args.file else []
    written += install_decoders(args.dir or user_decoders()) if args.decoders else []
    written += install_dissectors(args.dir or user_plugins()) if args.wireshark else []
    paths = [str(path) for path in written]
    show_data(args, {"files": paths}, paths)
    return 0


def shipped_folder(folder: str) -> Path:
    """A folder of this package, of the checkout, or of an installation. Raises BadInput."""
    installed = Path(sys.prefix) / "share/psabench" / folder
    for place in (BUNDLE / "share/psabench" / folder, CHECKOUT / folder, installed):
        if place.is_dir():
            return place
    raise BadInput(expected(f"the folder {folder} of psabench", "none"))


def scope_of(vcd: Path) -> str:
    """The board of a recording, which its first scope names; "": none. Raises BadInput."""
    scope = SCOPE.search(read_head(vcd))
    return scope[1].decode() if scope else ""


def lines_of(vcd: Path) -> list[str]:
    """The lines of a recording, in its order. Raises BadInput."""
    return [name.decode() for name in LINE.findall(read_head(vcd).partition(b"$enddefinitions")[0])]


def write_sessions(vcd: Path, keep: Sequence[Path] = ()) -> list[Path]:
    """Sessions beside a VCD, of the board that its scope names, less those to keep. Raises BadInput, OutputError."""
    board, lines = scope_of(vcd), lines_of(vcd)
    if not board or not lines:
        raise BadInput(expected("a VCD file with a scope and wires", "another file", vcd))
    texts = board_texts(board, span_of(vcd)) if board in SESSIONS else {".gtkw": gtkw_text(board, lines)}
    written = [(vcd.with_suffix(ending), text) for ending, text in texts.items() if vcd.with_suffix(ending) not in keep]
    for path, text in written:
        replace_file(path, text)
    return [path for path, _ in written]


def board_texts(board: str, span: Span) -> dict[str, str]:
    """By ending: they begin where the board's sessions do, or at the first edge of a recording without that instant.

    PulseView counts from a recording's first instant on, GTKWave from power-on.
    """
    from_ns = window_start_ns(board, span)
    pulseview_ns = SESSIONS[board].from_ns if from_ns is None else from_ns
    return {".gtkw": gtkwave_text(board, from_ns), ".pvs": pulseview_text(board, pulseview_ns - span.start_ns)}


def window_start_ns(board: str, span: Span) -> int | None:
    """The first edge of a recording without the instants at which the board's sessions begin; None: it has them."""
    session = SESSIONS[board]
    has_them = all(span.start_ns <= t_ns < span.end_ns for t_ns in (session.from_ns, session.gtk_from_ns))
    return None if has_them else span.edge_ns


def write_pictures(args: argparse.Namespace) -> list[Path]:
    """The window of a recording, as asked for. Raises BadInput, OutputError."""
    from psabench.link.vcd import read_vcd  # NumPy: session files do without
    from psabench.report.wavedrom import Window, wavedrom_text, window_picture

    check_there(args.file, "a VCD file")
    try:
        vcd = read_vcd(args.file)
        window = Window(
            lines=args.lines.split(",") if args.lines is not None else list(vcd.wires),
            start_ns=vcd.start_ns if args.from_ns is None else args.from_ns,
            end_ns=vcd.end_ns if args.to_ns is None else args.to_ns,
            tick_ns=args.tick_ns,
        )
        title = args.title or args.file.name
        made: dict[Path, str] = {}
        if args.wavedrom:
            made[args.wavedrom] = wavedrom_text(vcd, window, title)
        if args.svg:
            made[args.svg] = window_picture(vcd, [window], title)
    except ValueError as e:
        raise BadInput(f"{args.file}: {e}") from e
    for path, text in made.items():
        replace_file(path, text)
    return list(made)


def gtkw_text(scope: str, lines: Sequence[str]) -> str:
    """A GTKWave save file with all lines, in the order of the recording."""
    return "\n".join(["[timestart] 0", "@28", *(f"{scope}.{line}" for line in lines), ""])


def install_dissectors(folder: Path) -> list[Path]:
    """Wireshark's plugins. Raises BadInput, OutputError."""
    try:
        from psabench.logs import plugins  # pymavlink, the generator of one of them
    except ImportError as e:
        raise no_package(e, "--wireshark") from e
    return plugins.install_dissectors(shipped_folder("share") / "wireshark", folder)


def install_decoders(folder: Path) -> list[Path]:
    """Copies of the decoders, which replace earlier ones. Raises BadInput, OutputError."""
    written = []
    for decoder in sorted(d for d in shipped_folder("decoders").iterdir() if (d / "pd.py").is_file()):
        try:
            (folder / decoder.name).mkdir(parents=True, exist_ok=True)
            for source in sorted(decoder.glob("*.py")):
                shutil.copyfile(source, folder / decoder.name / source.name)
        except OSError as e:
            raise output_error(folder / decoder.name, e) from e
        written.append(folder / decoder.name)
    return written
