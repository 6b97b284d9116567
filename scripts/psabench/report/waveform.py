"""Pictures of a VCD excerpt as SVG: what a logic analyser would show, for README and docs.

`python -m psabench.report.waveform RUN.vcd frame OUT.svg` draws the first whole frame on INT, DATA and CLK;
`... setup OUT.svg` draws each transfer of the set-up after Res; `... rdata OUT.svg` the first RDATA that an ADS1256 of
the library was asked for. `... cycle OUT.svg` and `... handover OUT.svg` draw the cycle of reading of a PSD-1
(boards/psd1/waveform.py). Same input, same bytes; light and dark pages.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from psabench.boards.psd1 import waveform as waveform_psd1
from psabench.errors import BenchError, check_there, expected
from psabench.link.own import replace_file
from psabench.link.vcd import Vcd, read_vcd
from psabench.report.drawing import Panel, Section, Tag, need, render


def frame_words(vcd: Vcd, fall_ns: int, rise_ns: int, word_bits: int) -> list[Tag]:
    """The words of a frame, from the rises of CLK between two edges of INT; of a torn one as far as its bits go."""
    rises = vcd.wires["CLK"].edges_ns(1)
    rises = rises[(rises > fall_ns) & (rises < rise_ns)]
    bits = vcd.wires["Data"].at(rises).astype(np.int64)
    half = int(rises[1] - rises[0]) // 2
    tags = []
    for i, name in enumerate("XYZT"):
        at, sent = rises[i * word_bits :][:word_bits], bits[i * word_bits :][:word_bits]
        if not at.size:
            break
        value = int((sent << np.arange(at.size)).sum())
        signed = value - (value >> (word_bits - 1) << word_bits)
        fields = f"{value & 0xFFFF:04X}h" + (f" ch{value >> 16 & 15} st{value >> 20 & 15:X}" if word_bits > 16 else "")
        text = f"{name} = {fields if name == 'T' else signed}" if at.size == word_bits else f"{at.size} bits"
        tags.append(Tag("Data", int(at[0]) - half, int(at[-1]) + half, text))
    return tags


def _first_frame(vcd: Vcd, bits: int) -> tuple[int, int]:
    """INT fall and rise with that many rises of CLK between them."""
    clk = vcd.wires["CLK"].edges_ns(1)
    for fall_ns in vcd.wires["Int"].edges_ns(0).tolist():
        rises = vcd.wires["Int"].edges_ns(1)
        for rise_ns in rises[rises > fall_ns].tolist()[:1]:
            if np.count_nonzero((clk > fall_ns) & (clk < rise_ns)) == bits:
                return fall_ns, rise_ns
    raise ValueError(expected(f"a whole frame: Int low with {bits} pulses of CLK", "none"))


def frame_picture(vcd: Vcd, word_bits: int = 32) -> str:
    """The first whole frame, and a closer look at the pause between its first two words. Raises ValueError."""
    rows = ("Int", "Data", "CLK")
    need(vcd, set(rows))
    fall_ns, rise_ns = _first_frame(vcd, 4 * word_bits)
    tags = frame_words(vcd, fall_ns, rise_ns, word_bits)
    margin = (rise_ns - fall_ns) // 30
    whole = Section(fall_ns - margin, rise_ns + margin, fall_ns)
    period = (tags[1].start_ns - tags[0].end_ns) // 4
    near = (
        Section(fall_ns - period, fall_ns + 14 * period, fall_ns, "INT falls, first bits of X"),
        Section(tags[0].end_ns - 7 * period, tags[1].start_ns + 7 * period, fall_ns, "pause of 4 CLK periods"),
    )
    title = f"PSA-2 frame at t = {fall_ns / 1e6:.3f} ms: 4 words of {word_bits} bits, least significant bit first"
    return render(vcd, (Panel(rows, (whole,), tags), Panel(rows, near)), title)


def spi_bytes(vcd: Vcd, row: str, edges_ns: Sequence[int]) -> list[Tag]:
    """Bytes of a line, most significant bit first, sampled at these edges of SClk."""
    tags = []
    for i in range(0, len(edges_ns) - 7, 8):
        at = np.array(edges_ns[i : i + 8], np.int64)
        value = int("".join(map(str, vcd.wires[row].at(at - 1).tolist())), 2)
        half = int(at[1] - at[0]) // 2
        tags.append(Tag(row, int(at[0]) - half, int(at[-1]) + half, f"{value:02X}"))
    return tags


def _transfers(vcd: Vcd, until_ns: int) -> list[tuple[str, list[int]]]:
    """Sampling edges of each transfer before an instant: ("DIn" or "DInT", edges of SClk)."""
    found: list[tuple[str, list[int]]] = []
    cst = vcd.wires["CST"]
    for start, end in zip(cst.edges_ns(0).tolist(), cst.edges_ns(1).tolist(), strict=False):
        falls = vcd.wires["SClk"].edges_ns(0)  # mode 1: sampled where SClk falls
        found.append(("DInT", falls[(falls > start) & (falls <= end)].tolist()))
    rises = vcd.wires["SClk"].edges_ns(1)
    for t in rises[cst.at(rises) == 1].tolist():
        if not found or found[-1][0] == "DInT" or t - found[-1][1][-1] > 20_000:  # bytes of a transfer are closer
            found.append(("DIn", []))
        found[-1][1].append(t)
    return sorted((f for f in found if f[1] and f[1][0] < until_ns), key=lambda f: f[1][0])


def setup_picture(vcd: Vcd) -> str:
    """The set-up after Res, up to the first SYNC_A: each transfer in a section of its own, and the two SYNC pulses.

    Raises ValueError when there is no transfer, or a line is missing.
    """
    rows = ("DRD_A", "DRD_T", "SClk", "DIn", "CST", "DInT", "SYNC_T", "SYNC_A")
    need(vcd, set(rows))
    sync = {name: vcd.wires[name].t_ns[1:3].tolist() for name in ("SYNC_T", "SYNC_A")}
    until_ns = sync["SYNC_A"][0] if sync["SYNC_A"] else vcd.end_ns
    parts: list[tuple[int, int, int, float]] = []  # start, end, margin, share of the width
    tags: list[Tag] = []
    for row, at in _transfers(vcd, until_ns):
        tags += spi_bytes(vcd, row, at)
        parts.append((at[0], at[-1], max((at[-1] - at[0]) // 8, 2000), 1.0))
    for pulse in sync.values():
        if len(pulse) == 2:
            parts.append((pulse[0], pulse[1], 2 * (pulse[1] - pulse[0]), 0.6))
    if not parts:
        raise ValueError(expected("a transfer of the set-up", "none"))
    parts.sort()
    sections = [
        Section(start - margin, end + margin, start, f"{n}. {start / 1e6:.3f} ms")
        for n, (start, end, margin, _) in enumerate(parts, start=1)
    ]
    panel = Panel(rows, sections, tags, [share for *_, share in parts])
    return render(vcd, (panel,), "Set-up after Res: each step at its data-ready event, bytes in order of sending")


def rdata_picture(vcd: Vcd) -> str:
    """The first RDATA of an ADS1256 in a recording of the library: command, t6, 24 bits. Raises ValueError."""
    rows = ("DRDY", "CS", "SCLK", "DIN", "DOUT")
    need(vcd, set(rows))
    falls = vcd.wires["SCLK"].edges_ns(0)  # mode 1: sampled where SCLK falls
    cs = vcd.wires["CS"]
    for start, end in zip(cs.edges_ns(0).tolist(), cs.edges_ns(1).tolist(), strict=False):
        at = falls[(falls > start) & (falls <= end)].tolist()
        sent = spi_bytes(vcd, "DIN", at)
        if len(sent) != 4 or sent[0].text != "01":
            continue
        word = spi_bytes(vcd, "DOUT", at)[1:]
        code = int("".join(t.text for t in word), 16)
        signed = code - (code >> 23 << 24)
        margin = (end - start) // 30
        tags = [Tag("DIN", sent[0].start_ns, sent[0].end_ns, "01 RDATA"), *word]
        section = Section(start - 2 * margin, end + margin, start)
        return render(vcd, (Panel(rows, (section,), tags),), f"RDATA at t = {start / 1e6:.3f} ms: code {signed}")
    raise ValueError(expected("an RDATA of four bytes", "none"))


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; 2 for bad input, with one line that says what would be right."""
    args = list(sys.argv[1:] if argv is None else argv)
    pictures = {
        "frame": frame_picture,
        "setup": setup_picture,
        "rdata": rdata_picture,
        "cycle": waveform_psd1.cycle_picture,
        "handover": waveform_psd1.handover_picture,
    }
    if len(args) != 3 or args[1] not in pictures:
        print(f"usage: python -m psabench.report.waveform RUN.vcd {'|'.join(pictures)} OUT.svg", file=sys.stderr)
        return 2
    try:
        check_there(Path(args[0]), "a VCD file")
        replace_file(Path(args[2]), pictures[args[1]](read_vcd(Path(args[0]))))
    except (OSError, ValueError) as err:
        print(f"waveform: {args[0]}: {err}", file=sys.stderr)
        return 2
    except BenchError as err:
        print(f"waveform: {err}", file=sys.stderr)
        return err.exit_status
    return 0


if __name__ == "__main__":
    sys.exit(main())
