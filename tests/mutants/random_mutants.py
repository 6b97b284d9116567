"""Random mutants: which of all places of all files are taken is drawn from the seed."""

from __future__ import annotations

import random
import re
from pathlib import Path

from tests.mutants.declared import Mutant, Target
from tests.mutants.operators import Place, places

# By the beginning of a file's name: which boards it is run on; the first row that fits. Other files are not mutated.
ON: tuple[tuple[str, str], ...] = (
    ("emu/board/psa2/", "psa2"),
    ("emu/chip/ads1282/", "psa2"),
    ("emu/chip/ads1256/", "psa2"),
    ("emu/board/psd1/", "psd1 psd1:psd1_host"),
    ("emu/chip/ad7712/", "psd1"),
    ("emu/board/pmka/", "pmka"),
    ("emu/board/pik/", "pik"),
    ("emu/board/gyro/", "gyro"),
    ("emu/board/receiver/", "receiver"),
    ("emu/board/", "pmka"),
    ("emu/canopen/", "psa2"),
    ("emu/link/can/", "psa2"),
    ("emu/link/line/bus", "psd1:psd1_host"),
    ("emu/link/line/", "psa2"),
    ("emu/link/", "psa2"),
)
# What no board of these has: pins that no one drives edge by edge, faults, what only truth and digest tell. Of the
# links what the suite does not use, logs, protocols of other programs, and slcan: its time stamps are the machine's, so
# that no two runs look alike.
LEFT_OUT = re.compile(
    r"/(fault|pins|gpio|board|profile|profile_set|mod|cal|hpf|cic|uds\w*|isotp|http|scpi_port|own_file|can_log|socketcan|slcan\w*|"
    r"cannelloni_\w+|dgram_can|udp_\w+)\.c$"
)


def _name(path: str) -> str:
    """emu/chip/ads1282/conv.c: ads1282-conv; emu/canopen/co_sdo.c: co-sdo; emu/link/can/slcan.c: can-slcan."""
    p = Path(path)
    room = f"{p.parent.name}-" if len(p.parts) > 3 or p.parts[1] == "link" else ""
    return room + p.stem.replace("_", "-")


def mutant_of(path: str, text: str, place: Place, on: str) -> Mutant:
    """The text before the place is its address: it is there once."""
    kind, begin, end, new = place
    line, name = text.count("\n", 0, begin) + 1, _name(path)
    return Mutant(
        id=f"{name}-{line}-{begin - text.rfind(chr(10), 0, begin)}-{kind}",
        kind=kind,
        file=path,
        old=text[:end],
        new=text[:begin] + new,
        on=tuple(map(Target.of, on.split())),
    )


def mutated_files(root: Path) -> dict[str, str]:
    """The files that are mutated, and the boards that each is run on."""
    found: dict[str, str] = {}
    for prefix, on in ON:
        for file in sorted(root.glob(f"{prefix}*.c")):
            path = file.relative_to(root).as_posix()
            if not LEFT_OUT.search(path):
                found.setdefault(path, on)
    return found


def random_mutants(root: Path, count: int, seed: int) -> list[Mutant]:
    """So many, all different, the same for one seed and one state of the sources; each place as likely as any other."""
    boards = mutated_files(root)
    texts = {path: (root / path).read_text(encoding="utf-8") for path in boards}
    found = [(path, place) for path, text in texts.items() for place in places(text)]
    drawn = random.Random(seed).sample(found, min(count, len(found)))
    return [mutant_of(path, texts[path], place, boards[path]) for path, place in drawn]
