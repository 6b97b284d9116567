"""`psabench view FILE`: a recording of the lines in PulseView or GTKWave; what opens other files."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from psabench.errors import BadInput, BenchError, expected
from psabench.logs.decoded_vcd import write_decoded
from psabench.logs.viewers import shipped_folder, write_sessions

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")  # of X11 and Wayland
CAN_LOG = "psabench decode {file} prints its values, psabench panel --recording {file} plays it in a browser"
# What opens the files of psabench that are no waveforms, by ending.
OPENED_BY: Mapping[str, str] = {
    **dict.fromkeys((".asc", ".blf", ".csv", ".db", ".log", ".mf4", ".trc"), CAN_LOG),
    ".lcmlog": f"lcm-logplayer plays it, {CAN_LOG}",
    ".mcap": f"Foxglove and Lichtblick open it, {CAN_LOG}",
    ".pcap": f"wireshark {{file}} opens it, {CAN_LOG}",
    ".pcapng": "wireshark {file} opens it",
    ".fst": "gtkwave {file} opens it; PulseView after fst2vcd",
    ".sr": "pulseview {file} opens it",
    ".html": "a web browser opens it",
}


@dataclass(frozen=True, slots=True)
class Start:
    """A program to start: its words, and what its environment has in addition."""

    words: Sequence[str]
    environment: Mapping[str, str] = field(default_factory=dict)

    def command_line(self) -> str:
        """As a shell takes it."""
        return " ".join([*(f"{k}={shlex.quote(v)}" for k, v in self.environment.items()), shlex.join(self.words)])


def start_of(file: Path, program: str | None, decode_s: float) -> Start:
    """What opens FILE in the program, or in the first that is installed. Raises BadInput, BenchError.

    decode_s: how much of it is decoded for GTKWave; PulseView decodes by itself.
    """
    _check_kind(file)
    return PROGRAMS[program or _first_installed()](file, _ensure_sessions(file), decode_s)


def view_file(file: Path, program: str | None, decode_s: float) -> None:
    """Opens FILE. Raises BadInput, BenchError."""
    start = start_of(file, program, decode_s)
    program = start.words[0]
    panel = f"psabench panel --recording {shlex.quote(str(file))} shows it in a browser"
    if not shutil.which(program):
        raise BadInput(expected(f"{program} (apt-get install {program})", f"none; {panel}", "view"))
    if not any(os.environ.get(name) for name in DISPLAYS):
        known = " or ".join(f"${name}" for name in DISPLAYS)
        raise BadInput(expected(known, f"none; --print shows the command, {panel}", "view"))
    done = subprocess.run(start.words, env={**os.environ, **start.environment}, check=False)
    if done.returncode:
        raise BenchError(expected("exit status 0", str(done.returncode), program))


def _check_kind(file: Path) -> None:
    ending = file.suffix.lower()
    if ending in OPENED_BY:
        raise BadInput(
            expected("a VCD file", f"{ending}; {OPENED_BY[ending].format(file=shlex.quote(str(file)))}", file)
        )


def _first_installed() -> str:
    """PulseView where there is none: it decodes."""
    return next(filter(shutil.which, PROGRAMS), "pulseview")


def _ensure_sessions(vcd: Path) -> Mapping[str, Path]:
    """Session files beside the recording, by ending: those that are there, which users may have changed, or new."""
    kept = [path for ending in (".pvs", ".gtkw") if (path := vcd.with_suffix(ending)).is_file()]
    return {path.suffix: path for path in [*write_sessions(vcd, keep=kept), *kept]}


def _start_pulseview(vcd: Path, sessions: Mapping[str, Path], decode_s: float) -> Start:
    """-c: without the sessions that were open before. The file of the same base name it finds by itself."""
    decoders = {"SIGROKDECODE_DIR": str(shipped_folder("decoders"))}
    return Start(["pulseview", "-c", "-i", str(vcd), "-I", "vcd"], decoders)


def _start_gtkwave(vcd: Path, sessions: Mapping[str, Path], decode_s: float) -> Start:
    """On a copy with decoded rows, or on the lines alone where sigrok is not installed or fails."""
    lines = Start(["gtkwave", str(vcd), str(sessions[".gtkw"])])
    if not shutil.which("sigrok-cli"):
        _print_note(expected("sigrok-cli (apt-get install sigrok-cli)", "none; no decoded rows", "view"))
        return lines
    try:
        decoded = write_decoded(vcd, decode_s)
    except BenchError as e:
        _print_note(f"{e}; no decoded rows")
        return lines
    return Start(["gtkwave", *map(str, decoded)]) if decoded else lines


def _print_note(text: str) -> None:
    print(f"psabench: {text}", file=sys.stderr)


PROGRAMS: Mapping[str, Callable[[Path, Mapping[str, Path], float], Start]] = {
    "pulseview": _start_pulseview,
    "gtkwave": _start_gtkwave,
}
