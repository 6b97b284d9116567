"""Hosts that are broken on purpose: replacements in docs/examples/host.c, and the requirement that each breaks."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "docs/examples"


@dataclass(frozen=True, slots=True)
class BrokenHost:
    """old: text that occurs once in the source; new: the replacement; case: where it shows."""

    name: str
    old: str
    new: str
    case: str
    requirement: str
    source: str = "host.c"
    also: tuple[str, str] = ("", "")  # a second replacement, where the host has two locks on that door


BROKEN = (
    BrokenHost(
        "no_sign",
        "(int32_t)(U16(d) << 8 | (uint32_t)(d)[2] << 24) / 256",
        "(int32_t)(U16(d) | (uint32_t)(d)[2] << 16)",
        "good",
        "HOST-CAN-11",
        "socketcand.h",
    ),
    BrokenHost(
        "axes_swapped",
        "code[0], code[1], code[2], (int16_t)",
        "code[1], code[0], code[2], (int16_t)",
        "good",
        "HOST-CAN-11",
    ),
    BrokenHost("losses_untold", 'steps > 1) TELL("lost"', 'steps > 2) TELL("lost"', "lost", "HOST-LOST-01"),
    BrokenHost("halves_mixed", "!fresh && llabs(ticks - due) > 200 + steps / 2", "0", "mixed", "HOST-CAN-01"),
    BrokenHost("torn_untold", '        else TELL("torn", "%d", 1);\n', "", "torn", "HOST-CAN-02"),
    BrokenHost(
        "twice_taken",
        "(s.half || memcmp(s.zt, d, 8))",
        "(s.half = 1)",
        "twice",
        "HOST-CAN-08",
        also=("if (s.begun && !steps) return;", ""),
    ),
    BrokenHost(
        "short_taken", "if ((s.half = n == 8))", "if ((s.half = n == 8) || (s.half = 1))", "length", "HOST-CAN-05"
    ),
    BrokenHost("negative_limit", "code[i] == -0x800000", "code[i] == -0x7FFFFF", "over_range", "HOST-RANGE-01"),
    BrokenHost(
        "deaf_to_boot_up", "if (!d[0]) s = (struct state)", "if (0) s = (struct state)", "restart", "HOST-RST-01"
    ),
    BrokenHost("unsettled_taken", "if (!(z[5] & 1)) return;", "", "flags", "HOST-SETTLE-01"),
    BrokenHost("overrun_untold", "if (z[5] & 4) TELL", "if (z[5] & 2) TELL", "flags", "HOST-OVER-01"),
    BrokenHost(
        "silence_untold",
        "now - s.sample_ms > STALE_MS",
        "now - s.sample_ms > 10 * STALE_MS",
        "silence",
        "HOST-STALE-01",
    ),
    BrokenHost("frozen_untold", "(s.same >= 999)", "(s.same >= 9999)", "frozen", "HOST-STALE-02"),
    BrokenHost("z_unread", "{0x04, 0x20, 2, 0xFF, 0x56}", "{0x00, 0x20, 2, 0xFF, 0x56}", "config0_z", "HOST-SETUP-01"),
    BrokenHost(
        "impatient",
        "if (d[0] == 0x80) s.ask_ms = now_ms() + AGAIN_MS;",
        "if (d[0] == 0x80) s.ask_ms = 0;",
        "power_on",
        "HOST-SETUP-02",
    ),
    BrokenHost("asks_too_often", "ANSWER_MS = 1000", "ANSWER_MS = 100", "slow", "HOST-CAN-10"),
    BrokenHost("rate_untold", "s.t_us += 4 * ticks", "s.t_us += 4 * due", "rate", "HOST-RATE-01"),
    BrokenHost("times_of_arrival", "(long long)s.t_us);", "(long long)now_ms() * 1000);", "delayed", "HOST-TIME-01"),
    BrokenHost(
        "emergency_untold",
        "if (id == 0x080 + node && n == 8)",
        "if (id == 0x081 + node && n == 8)",
        "emcy",
        "HOST-CAN-06",
    ),
    BrokenHost("gone_untold", "GONE_MS = 3500", "GONE_MS = 35000", "off", "HOST-CAN-07"),
    BrokenHost("wrap_is_a_loss", "(seq - s.seq) & 0xFFFF", "(seq - s.seq)", "good", "HOST-CAN-03"),
    BrokenHost("neighbours_taken", "id == 0x280 + node", "(id & 0x780) == 0x280", "others", "HOST-CAN-04"),
    BrokenHost("no_end", 'return TELL("end", "%s", "true"), 0;', "return 1;", "good", "HOST-RES-03"),
    BrokenHost(
        "leaves_some_out",
        "if (!(z[5] & 1)) return; /* not settled */",
        "if (!(z[5] & 1) || seq % 1000 == 7) return;",
        "good",
        "HOST-RES-01",
    ),
    BrokenHost("false_alarm", "if (z[5] & 4) TELL", "if (seq % 1000 == 7) TELL", "good", "HOST-RES-02"),
    BrokenHost("other_words", '"{\\"frame\\": %u', '"{\\"sample\\": %u', "good", "HOST-RES-04"),
    BrokenHost(
        "starts_unread", "s.started = ++s.row == ROWS;", "s.started = ++s.row >= 1;", "power_on", "HOST-SETUP-03"
    ),
    BrokenHost("prose", 'TELL("lost", "%u", steps - 1)', 'puts("lost some")', "lost", "HOST-LOST-01"),
)


def patched(text: str, name: str, changes: Iterable[tuple[str, str]]) -> str:
    """With each of them made; each text to be replaced must stand there once."""
    for old, new in changes:
        assert text.count(old) == 1, f"{name}: {old!r} occurs {text.count(old)} times"
        text = text.replace(old, new)
    return text


def build(folder: Path, broken: BrokenHost | None = None, main: str = "host.c") -> Path:
    """The example, or the broken one, compiled; the path of the program."""
    name = broken.source if broken else ""
    for file in EXAMPLES.glob("*.[ch]"):
        text = file.read_text(encoding="utf-8")
        if broken and file.name == name:
            text = patched(text, broken.name, [c for c in ((broken.old, broken.new), broken.also) if c[0]])
        (folder / file.name).write_text(text, encoding="utf-8")
    program = folder / "host"
    strict = [] if broken else ["-Wall", "-Wextra", "-Wconversion", "-Werror"]
    subprocess.run(["cc", "-std=c11", "-O1", *strict, "-o", program, folder / main], check=True, timeout=60)
    return program
