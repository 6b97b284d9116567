"""Hosts of PSD-1, PMKA and PIK that are broken on purpose: replacements in examples/vins_boards.py."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from broken_hosts import ROOT, patched

HOST = ROOT / "examples/vins_boards.py"
SUM_OF_INCREMENTS = "self.sums = [s + int(r[a][i]) for s, a in zip(self.sums, 'XYZ', strict=True)]"
MEAN_CT = "__import__('dataclasses').replace(rom, ct=rom.ct.mean(2, keepdims=True).repeat(2, 2))"


@dataclass(frozen=True, slots=True)
class BrokenBoardHost:
    """changes: texts that occur once in the source, and the replacement; place: in the command."""

    name: str
    board: str
    case: str
    requirement: str
    changes: tuple[tuple[str, str], ...]
    on_bus: bool = False


BROKEN_BOARDS = (
    BrokenBoardHost(
        "words_as_signed",
        "psd1",
        "psd1_good",
        "HOST-PSD1-04",
        (("a: int(r[a.upper()][i]) for", "a: int(r[a.upper()][i]) - 0x8000 for"),),
    ),
    BrokenBoardHost(
        "one_lost_untold", "psd1", "psd1_lost", "HOST-PSD1-05", (("    if lost:\n", "    if lost > 1:\n"),)
    ),
    BrokenBoardHost("mixed_taken", "psd1", "psd1_flags", "HOST-PSD1-03", (('if not r["MIXED"][i]:', "if True:"),)),
    BrokenBoardHost(
        "late_untold", "psd1", "psd1_flags", "HOST-PSD1-03", (('("OVERRUN", "LATE", "MIXED")', '("OVERRUN", "MIXED")'),)
    ),
    BrokenBoardHost(
        "low_bytes_alone",
        "psd1",
        "psd1_bus",
        "HOST-PSD1-01",
        (("words.append(port.read(axis).data)", "words.append(port.read(axis).data & 0xFF)"),),
        on_bus=True,
    ),
    BrokenBoardHost(
        "other_address",
        "psd1",
        "psd1_bus",
        "HOST-PSD1-01",
        (("words.append(port.read(axis).data)", "words.append(port.read(2 - axis).data)"),),
        on_bus=True,
    ),
    BrokenBoardHost(
        "late_strobes",
        "psd1",
        "psd1_bus",
        "HOST-PSD1-02",
        (
            (
                "words.append(port.read(axis).data)",
                "[port.read(4) for _ in range(10)]; words.append(port.read(axis).data)",
            ),
        ),
        on_bus=True,
    ),
    BrokenBoardHost(
        "spare_unseen",
        "pmka",
        "pmka_warm",
        "HOST-PMKA-01",
        (("self.run.append(row)", 'self.run.append(row | {"SERVES_K": 0.0})'),),
    ),
    BrokenBoardHost(
        "one_correction_for_both_signs",
        "pmka",
        "pmka_cold",
        "HOST-PMKA-02",
        (("self.rom, self.axes = rom,", f"self.rom, self.axes = {MEAN_CT},"),),
    ),
    BrokenBoardHost("gap_untold", "pmka", "pmka_lost", "HOST-PMKA-03", (("    if lost:\n", "    if lost > 1:\n"),)),
    BrokenBoardHost(
        "saturation_untold",
        "pmka",
        "pmka_lost",
        "HOST-PMKA-03",
        (("self.axes.watch(over)", "self.axes.watch(set())"),),
    ),
    BrokenBoardHost(
        "made_up",
        "pmka",
        "pmka_lost",
        "HOST-PMKA-03",
        (
            (
                "            if missing(seq, self.seq, WORD) or bad:\n                self.end()\n",
                "            missing(seq, self.seq, WORD)\n",
            ),
            ("            return tell(note=str(e))\n", "            vs = np.arange(3 * len(rows)).reshape(-1, 3)\n"),
        ),
    ),
    BrokenBoardHost(
        "increments_summed",
        "pik",
        "pik_lost",
        "HOST-PIK-01",
        (("self.add([int(r[c][i]) for c in self.columns], 1 << 32)", SUM_OF_INCREMENTS),),
    ),
    BrokenBoardHost(
        "no_wrap",
        "pik",
        "pik_bus",
        "HOST-PIK-02",
        (("for axis in range(3)], WORD)", "for axis in range(3)], 1 << 32)"),),
        on_bus=True,
    ),
    BrokenBoardHost(
        "y_out_of_sight",
        "pik",
        "pik_over",
        "HOST-PIK-03",
        (('{a for a in "xyz" if r[f"SAT', '{a for a in "xz" if r[f"SAT'),),
    ),
    BrokenBoardHost("no_end", "pik", "pik_lost", "HOST-RES-03", (("    tell(end=True)\n", ""),)),
    BrokenBoardHost("prose", "pik", "pik_lost", "HOST-RES-04", (("print(json.dumps(what))", "print(what)"),)),
)


def build(folder: Path, broken: BrokenBoardHost) -> Path:
    """The broken host; the path of the program."""
    program = folder / "host.py"
    program.write_text(patched(HOST.read_text(encoding="utf-8"), broken.name, broken.changes), encoding="utf-8")
    return program
