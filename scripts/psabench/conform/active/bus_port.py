"""The bus port: lines of text for the cycles of the parallel bus (docs/busport.md)."""

from __future__ import annotations

import itertools
import re

from psabench.conform.capture.bus_cycles import BUS, LINES, TAIL_S, Strobes, harmless, quiet, registers, say, strobes
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.raw_can import ABORT, Talk, dialogue, read, words
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect

DONE = re.compile(r"([RW]) ([0-9A-F]{2})h ([0-9A-F]{4}) t=(0|[1-9][0-9]*)")
REFUSED = re.compile(r"E ([a-z-]+) ([RW?-]) ([0-9A-F]{2}h|-) t=(0|[1-9][0-9]*)")
WHO = re.compile(r"I (\S+)((?: [0-9A-F]{2}h=\S+)+) t=(0|[1-9][0-9]*)")
NOWHERE = 0x20
MANY = 100  # lines at once
LOOKS = 8
# Rejections of the port by what they are over CAN (docs/busport.md, Answers).
ABORTS = {
    "no-address": 0x06090011,
    "read-only": 0x06010002,
    "write-only": 0x06010001,
    "not-ready": 0x08000022,
    "taken": 0x08000022,
    "too-short": 0x06090030,
    "bad-value": 0x06090030,
    "busy": 0x08000022,
}
STROBE_MS = 1
STROBE_NS = 1000


def _cycle(answer: str, letter: str, address: int) -> tuple[int, int]:
    """Word and time (ns) of a cycle that was carried out. Raises Failed for another answer."""
    m = DONE.fullmatch(answer)
    if m is None or m[1] != letter or int(m[2], 16) != address:
        raise Failed(repr(answer), f"{letter} {address:02X}h DDDD t=NS")
    return int(m[3], 16), int(m[4])


def _refusal(answer: str, code: str, letter: str, address: str) -> None:
    m = REFUSED.fullmatch(answer)
    if m is None or m.groups()[:3] != (code, letter, address):
        raise Failed(repr(answer), f"E {code} {letter} {address} t=NS")


@active("BUS-PORT-01", needs={"bus"})
def each_line_has_its_answer_in_turn(s: Dut) -> str:
    """A hundred lines at once, reads, questions and nonsense."""
    address = quiet(s)
    kinds = {f"R {address:X}": "R ", "?": "I ", f"R {NOWHERE:X}": "E no-address", "hello": "E syntax"}
    lines = [list(kinds)[k % len(kinds)] for k in range(MANY)]
    answers = say(s, *lines)
    times = []
    for line, answer in zip(lines, answers, strict=True):
        expect(answer.startswith(kinds[line]), f"another answer; said {answer!r} to {line!r}", f"{kinds[line]}...")
        times.append(_time_ns(answer))
    expect(times == sorted(times), "times that fall", "times in the order of the lines")
    return f"{MANY} lines, {MANY} answers in their order"


def _time_ns(answer: str) -> int:
    m = re.search(r" t=(\d+)$", answer)
    if m is None:
        raise Failed(repr(answer), "a time at its end")
    return int(m[1])


@active("BUS-PORT-02", needs={"bus"})
def a_read_cycle_and_its_answer(s: Dut) -> str:
    """R at an address that can always be read."""
    answer = say(s, f"R {quiet(s):X}")[0]
    _cycle(answer, "R", quiet(s))
    return answer


@active("BUS-PORT-03", needs={"bus"})
def a_write_cycle_and_its_answer(s: Dut) -> str:
    """W of what a register has."""
    address, word = harmless(s)
    answer = say(s, f"W {address:X} {word:X}")[0]
    found, _ = _cycle(answer, "W", address)
    return expect(found == word, answer, f"the word {word:04X}")


@active("BUS-PORT-04", needs={"bus"})
def refused_lines_say_why(s: Dut) -> str:
    """Lines that are none, numbers that are none, addresses that no one has, rights."""
    of = registers(s)
    ro = next(a for a, access in of.values() if access == "ro")
    a = f"{quiet(s):02X}h"
    wanted = [
        ("hello", "syntax", "-", "-"),
        ("", "syntax", "-", "-"),
        ("R", "syntax", "R", "-"),
        ("R x", "number", "R", "-"),
        (f"R {quiet(s):X} 0", "number", "R", a),
        (f"R {quiet(s):X} 1000000000", "number", "R", a),
        (f"R {quiet(s):X} 800 1", "syntax", "R", a),
        ("W 1", "syntax", "W", "01h"),
        ("W 1 12345", "number", "W", "01h"),
        ("? 1", "syntax", "?", "-"),
        (f"R {NOWHERE:X}", "no-address", "R", f"{NOWHERE:02X}h"),
        (f"W {ro:X} 0", "read-only", "W", f"{ro:02X}h"),
    ]
    wo = next((address for address, access in of.values() if access == "wo"), None)
    if wo is not None:
        wanted.append((f"R {wo:X}", "write-only", "R", f"{wo:02X}h"))
    answers = say(s, *(line for line, *_ in wanted))
    for (_, *due), answer in zip(wanted, answers, strict=True):
        _refusal(answer, *due)
    return f"{len(wanted)} lines refused, each with its code"


@active("BUS-PORT-05", needs={"bus"})
def it_says_who_is_there(s: Dut) -> str:
    """The line ?"""
    answer = say(s, "?")[0]
    m = WHO.fullmatch(answer)
    if m is None:
        raise Failed(repr(answer), "I BOARD AAh=NAME ... t=NS")
    found = {int(pair.split("h=")[0], 16): pair.split("h=")[1] for pair in m[2].split()}
    due = {address: name for name, (address, _) in registers(s).items()}
    return expect(m[1] == s.variant.family and found == due, answer, f"{s.variant.family} and {due}")


@active("BUS-PORT-06", needs={"bus"})
def a_long_line_is_refused(s: Dut, row: Requirement) -> str:
    """A good line made as long as a line may be by blanks, and one longer."""
    most = int(row.limit("line_max_chars"))
    good = f"R {quiet(s):X}"
    answers = say(s, good.ljust(most), good.ljust(most + 1), good)
    _cycle(answers[0], "R", quiet(s))
    expect(REFUSED.fullmatch(answers[1]) and answers[1].startswith("E overlong "), repr(answers[1]), "E overlong")
    _cycle(answers[2], "R", quiet(s))
    return f"{most} characters taken; {answers[1]}"


@active("BUS-PORT-07", needs={"bus"})
def spelling_makes_no_difference(s: Dut) -> str:
    """The same line in either case, with h, two digits, blanks, a CR."""
    a = quiet(s)
    lines = [f"r {a:x}", f"R {a:02X}h", f"r {a:02x}H\r", f"  R   {a:X}  ", f"R {a:X}\r", f"R\t{a:02X}"]
    for line, answer in zip(lines, say(s, *lines), strict=True):
        try:
            _cycle(answer, "R", a)
        except Failed as e:
            raise Failed(f"another answer; said {answer!r} to {line!r}", e.due) from e
    return f"{len(lines)} spellings of one line"


@active("BUS-PORT-08", needs={"bus"})
def times_go_on_by_the_strobe(s: Dut) -> str:
    """Three cycles at once with a strobe of 1 ms each: their times."""
    strobe_ns = STROBE_MS * 1_000_000
    line = f"R {quiet(s):X} {strobe_ns}"
    times = [_cycle(a, "R", quiet(s))[1] for a in say(s, line, line, line, dwell_s=3.1 * STROBE_MS * 1e-3)]
    apart_ns = [b - a for a, b in itertools.pairwise(times)]
    return expect(min(apart_ns) >= strobe_ns, f"{apart_ns} ns apart", f"{strobe_ns} ns and more")


def _strobed(s: Dut, strobe_ns: int) -> tuple[int, Strobes]:
    """Time of the answer to a cycle with this strobe, and the cycles that the lines show at its address."""
    with s.take() as take:
        _, t_ns = _cycle(say(s, f"R {quiet(s):X} {strobe_ns}", dwell_s=1e-4)[0], "R", quiet(s))
        s.run_for(TAIL_S)
    if take.lines is None:
        raise Inconclusive("no lines were recorded")
    return t_ns, strobes(take.lines).at(quiet(s))


@active("BUS-PORT-08", needs={"bus", "pins", "exact"})
def times_are_those_of_cs(s: Dut) -> str:
    """A cycle: its time beside the rise of CS."""
    t_ns, found = _strobed(s, STROBE_NS)
    rises = found.rise_ns.tolist()
    saw = f"t={t_ns}, CS rises at {rises} ns"
    expect(rises == [t_ns], saw, "the rise of CS", at_ns=rises[0] if rises else None, lines=LINES)
    return f"t={t_ns}, the rise of CS"


@active("BUS-PORT-10", needs={"bus", "pins"})
def a_strobe_is_as_long_as_it_is_told(s: Dut, row: Requirement) -> str:
    """A cycle with a strobe of so many ns, in decimal: how long is CS low?"""
    _, found = _strobed(s, STROBE_NS)
    low_ns = (found.rise_ns - found.fall_ns).tolist()
    slack_ns = row.limit("tolerance_ns")
    if len(low_ns) != 1 or abs(low_ns[0] - STROBE_NS) > slack_ns:
        at_ns = int(found.fall_ns[0]) if low_ns else None
        raise Failed(f"CS low for {low_ns} ns", f"once, {STROBE_NS} +- {slack_ns:g} ns", at_ns=at_ns, lines=LINES)
    return f"CS low for {low_ns[0]} ns"


@dialogue("BUS-PORT-09", needs={"bus", "can"}, reset=True)
def the_port_reads_what_can_reads(t: Talk) -> str:
    """Each readable register over CAN, by the port, over CAN again; those that stood still."""
    same = []
    t.s.wait_ready()
    for name, (address, access) in registers(t.s).items():
        if access != "wo" and _read_alike(t, address):
            same.append(name)
    conclusive(same, "no register stood still between two reads")
    return f"{', '.join(same)}: the same"


def _read_alike(t: Talk, address: int) -> bool:
    """Whether the port and CAN say the same; False: it moves. A flag that comes and goes may differ, but not always."""
    request = read(BUS, address + 1)
    for _ in range(LOOKS):
        first, answer, last = t.ask(request), say(t.s, f"R {address:X}")[0], t.ask(request)
        if first != last:
            return False
        if _agree(first, answer):
            return True
    raise Failed(f"CAN reads {words(first)}; said {answer!r}", "the same")


def _agree(over_can: bytes, answer: str) -> bool:
    done, refused = DONE.fullmatch(answer), REFUSED.fullmatch(answer)
    if over_can[0] == ABORT:
        return refused is not None and ABORTS.get(refused[1]) == int.from_bytes(over_can[4:], "little")
    return done is not None and int(done[3], 16) == int.from_bytes(over_can[4:6], "little")
