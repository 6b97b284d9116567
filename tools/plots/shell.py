#!/usr/bin/env python3
"""Draw docs/img/shell.svg: a real session of `psabench shell` in a terminal, as it looks while a line is typed.

    tools/plots/shell.py [docs/img/shell.svg]

The screen is kept by a terminal of a few lines that knows what prompt_toolkit sends: cursor, erase, colours.
"""

from __future__ import annotations

import os
import pty
import re
import select
import struct
import subprocess
import sys
import tempfile
import termios
import time
from contextlib import suppress
from dataclasses import dataclass, field
from fcntl import ioctl
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).resolve().parents[2]
COLUMNS, ROWS = 104, 34
CELL_W, CELL_H, SIZE = 8.0, 17.0, 13.3
TIMEOUT_S = 20.0
SESSION = (  # keys, and what must be on the screen before the next
    ("", "psa>"),
    ("dut.ready\r", "psa>"),
    ("dut.registers\r", "FSC2"),
    ("dut.stream 20\r", "axes"),
    ("table.rate 1 10dps\r", "psa>"),
    ("wait 500ms\r", "psa>"),
    ("table.read 1\r", "mode"),
    ("faults.add line.missing_pulse a.line.CLK ", "pulse="),
)
PALETTE = "#000000 #b04040 #308040 #a07020 #3060b0 #804090 #308090 #c8c8c8".split()
BRIGHT = "#707070 #d06060 #50a060 #c09040 #5080d0 #a060b0 #50a0b0 #ffffff".split()
PAPER, INK = "#fbfbf8", "#202020"
CONTROL = re.compile(r"\x1b\[([?>]?)([0-9;]*)([A-Za-z])|\x1b[()][A-Z0-9]|\x1b[=>78]|\x1b\][^\x07]*\x07")


@dataclass(frozen=True, slots=True)
class Style:
    ink: str = INK
    paper: str = PAPER
    bold: bool = False
    reverse: bool = False

    def after(self, codes: list[int]) -> Style:
        """With these codes of SGR (ECMA-48 8.3.117) applied."""
        s = self
        for c in codes:
            if c == 0:
                s = Style()
            elif c == 1:
                s = Style(s.ink, s.paper, True, s.reverse)
            elif c in (7, 27):
                s = Style(s.ink, s.paper, s.bold, c == 7)
            elif 30 <= c <= 39:
                s = Style(INK if c == 39 else PALETTE[c - 30], s.paper, s.bold, s.reverse)
            elif 40 <= c <= 49:
                s = Style(s.ink, PAPER if c == 49 else PALETTE[c - 40], s.bold, s.reverse)
            elif 90 <= c <= 97:
                s = Style(BRIGHT[c - 90], s.paper, s.bold, s.reverse)
            elif 100 <= c <= 107:
                s = Style(s.ink, BRIGHT[c - 100], s.bold, s.reverse)
        return s

    @property
    def colours(self) -> tuple[str, str]:
        """Of letters and of what is behind them."""
        return (self.paper, self.ink) if self.reverse else (self.ink, self.paper)


@dataclass(slots=True)
class Screen:
    """cells[row][column]: letter and style."""

    row: int = 0
    column: int = 0
    style: Style = field(default_factory=Style)
    cells: list[list[tuple[str, Style]]] = field(default_factory=lambda: [_blank() for _ in range(ROWS)])

    def feed(self, text: str) -> None:
        at = 0
        while at < len(text):
            m = CONTROL.match(text, at)
            if m:
                self._control(m)
                at = m.end()
                continue
            self._letter(text[at])
            at += 1

    def _letter(self, c: str) -> None:
        if c == "\r":
            self.column = 0
        elif c == "\n":
            self._down()
        elif c == "\b":
            self.column = max(0, self.column - 1)
        elif c >= " ":
            if self.column >= COLUMNS:
                self.column = 0
                self._down()
            self.cells[self.row][self.column] = (c, self.style)
            self.column += 1

    def _down(self) -> None:
        if self.row == ROWS - 1:
            del self.cells[0]
            self.cells.append(_blank())
        else:
            self.row += 1

    def _control(self, m: re.Match[str]) -> None:
        numbers = [int(n) for n in (m[2] or "").split(";") if n]
        n = numbers[0] if numbers else 1
        move = {"A": (-n, 0), "B": (n, 0), "C": (0, n), "D": (0, -n)}.get(m[3] or "")
        if m[1]:
            return  # modes: they change nothing that is seen here
        if move:
            self.row = min(max(0, self.row + move[0]), ROWS - 1)
            self.column = min(max(0, self.column + move[1]), COLUMNS - 1)
        elif m[3] == "m":
            self.style = self.style.after(numbers or [0])
        elif m[3] == "H":
            self.row, self.column = (n - 1 for n in [*numbers, 1, 1][:2])
        elif m[3] in ("K", "J") and not numbers[:1] > [0]:
            self.cells[self.row][self.column :] = _blank()[self.column :]
            if m[3] == "J":
                self.cells[self.row + 1 :] = [_blank() for _ in range(ROWS - self.row - 1)]

    def text(self) -> str:
        return "\n".join("".join(c for c, _ in row).rstrip() for row in self.cells)

    def svg(self) -> str:
        width, height = COLUMNS * CELL_W + 16, ROWS * CELL_H + 16
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
            f'font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="{SIZE}">',
            f'<rect width="100%" height="100%" rx="6" fill="{PAPER}" stroke="#c0c0c0"/>',
        ]
        for r, row in enumerate(self.cells):
            at = 0
            while at < COLUMNS:
                end = at + 1
                while end < COLUMNS and row[end][1] == row[at][1]:
                    end += 1
                parts += _run(r, at, "".join(c for c, _ in row[at:end]), row[at][1])
                at = end
        return "\n".join([*parts, "</svg>"]) + "\n"


def _blank() -> list[tuple[str, Style]]:
    return [(" ", Style())] * COLUMNS


def _run(row: int, column: int, text: str, style: Style) -> list[str]:
    ink, paper = style.colours
    x, y = 8 + column * CELL_W, 8 + row * CELL_H
    parts = []
    if paper != PAPER:
        width = len(text) * CELL_W
        parts.append(f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{CELL_H}" fill="{paper}"/>')
    if text.strip():
        lead = len(text) - len(text.lstrip())
        shown, x = text.strip(), x + lead * CELL_W
        bold = ' font-weight="bold"' if style.bold else ""
        parts.append(
            f'<text x="{x:.1f}" y="{y + 13:.1f}" fill="{ink}"{bold} xml:space="preserve" '
            f'textLength="{len(shown) * CELL_W:.1f}">{escape(shown)}</text>'
        )
    return parts


def play(argv: list[str]) -> Screen:
    """The screen at the end of SESSION."""
    master, slave = pty.openpty()
    ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
    screen = Screen()
    with tempfile.TemporaryDirectory() as state:
        env = {**os.environ, "TERM": "xterm", "PROMPT_TOOLKIT_COLOR_DEPTH": "DEPTH_4_BIT", "XDG_STATE_HOME": state}
        process = subprocess.Popen(argv, stdin=slave, stdout=slave, stderr=slave, env=env, start_new_session=True)
        os.close(slave)
        try:
            for keys, wanted in SESSION:
                os.write(master, keys.encode())
                _until(master, screen, wanted, keys[-1:] in ("", "\r"))
        finally:
            process.terminate()
            while process.poll() is None and select.select([master], [], [], TIMEOUT_S)[0]:
                with suppress(OSError):  # no one has the other end open any more
                    os.read(master, 65536)
            os.close(master)
    return screen


def _until(master: int, screen: Screen, wanted: str, prompt: bool) -> None:
    """Until the text is there (and a new prompt, if one is due), and a second longer: the status bar never rests."""
    deadline_s = time.monotonic() + TIMEOUT_S
    enough_s = deadline_s
    while time.monotonic() < min(deadline_s, enough_s):
        if select.select([master], [], [], 0.2)[0]:
            chunk = os.read(master, 65536).decode(errors="replace")
            screen.feed(chunk)
            for _ in range(chunk.count("\x1b[6n")):
                os.write(master, f"\x1b[{screen.row + 1};{screen.column + 1}R".encode())
        line = "".join(c for c, _ in screen.cells[screen.row]).strip()
        if enough_s == deadline_s and wanted in screen.text() and (line == "psa>" or not prompt):
            enough_s = time.monotonic() + 1.0
    if enough_s == deadline_s:
        sys.exit(f"plot_shell: {wanted!r} never came; the screen:\n{screen.text()}")


def main() -> None:
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/img/shell.svg"
    screen = play([str(ROOT / ".venv/bin/psabench"), "shell", "table_rate", "--pace", "step"])
    out.write_text(screen.svg(), encoding="utf-8")
    print(screen.text())


if __name__ == "__main__":
    main()
