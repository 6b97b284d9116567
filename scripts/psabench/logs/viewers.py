"""`psabench waveform`: what PulseView and GTKWave load beside a VCD file, and the sigrok decoders in their folder."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from psabench.errors import BadInput, expected, output_error
from psabench.link.own import replace_file
from psabench.options import Parser
from psabench.places import BUNDLE, CHECKOUT

EPILOG = """\
examples:
  psabench waveform run.vcd              writes run.gtkw and run.pvs beside it
  psabench waveform --decoders           installs the sigrok decoders for this user

PulseView loads the .pvs file by itself; GTKWave: gtkwave run.vcd run.gtkw.
"""
MOST_HEAD = 1 << 20  # bytes of a VCD in which its lines are declared
SCOPE = re.compile(rb"\$scope\s+module\s+(\w+)\s+\$end")
LINE = re.compile(rb"\$var\s+wire\s+1\s+\S+\s+(\w+)\s+\$end")


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench waveform`. Raises BadInput."""
    p = Parser(prog="psabench waveform", description="Write viewer files, install decoders.", epilog=EPILOG)
    p.set_defaults(handler=_run_waveform)
    p.add_argument("file", type=Path, nargs="?", help="VCD file of psa-emu --vcd")
    p.add_argument("--decoders", action="store_true", help="copy the sigrok decoders into FOLDER")
    folder = user_decoders()
    p.add_argument("--dir", type=Path, metavar="FOLDER", default=folder, help="folder of decoders (%(default)s)")
    return p.parse_args(words)


def user_decoders() -> Path:
    """Where sigrok looks for a user's decoders."""
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local/share"
    return Path(data) / "libsigrokdecode/decoders"


def _run_waveform(args: argparse.Namespace) -> int:
    if args.file is None and not args.decoders:
        raise BadInput(expected("a VCD file or --decoders", "none", "waveform"))
    written = write_sessions(args.file) if args.file else []
    written += install_decoders(args.dir) if args.decoders else []
    for path in written:
        print(path)
    return 0


def shipped_folder(folder: str) -> Path:
    """A folder of this package, of the checkout, or of an installation. Raises BadInput."""
    installed = Path(sys.prefix) / "share/psabench" / folder
    for place in (BUNDLE / "share/psabench" / folder, CHECKOUT / folder, installed):
        if place.is_dir():
            return place
    raise BadInput(expected(f"the folder {folder} of psabench", "none"))


def write_sessions(vcd: Path) -> list[Path]:
    """Session files beside a VCD, of the board that its scope names. Raises BadInput, OutputError."""
    try:
        with vcd.open("rb") as file:
            head = file.read(MOST_HEAD).partition(b"$enddefinitions")[0]
    except OSError as e:
        raise BadInput(f"{vcd}: {e.strerror}") from e
    scope, lines = SCOPE.search(head), [name.decode() for name in LINE.findall(head)]
    if not scope or not lines:
        raise BadInput(expected("a VCD file with a scope and wires", "another file", vcd))
    board = scope[1].decode()
    written = []
    for ending in (".gtkw", ".pvs"):
        ours = shipped_folder("share") / f"{board}{ending}"
        text = (
            ours.read_text(encoding="utf-8") if ours.is_file() else gtkw_text(board, lines) if ending == ".gtkw" else ""
        )
        if text:
            replace_file(vcd.with_suffix(ending), text)
            written.append(vcd.with_suffix(ending))
    return written


def gtkw_text(scope: str, lines: Sequence[str]) -> str:
    """A GTKWave save file with all lines, in the order of the recording."""
    return "\n".join(["[timestart] 0", "@28", *(f"{scope}.{line}" for line in lines), ""])


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
