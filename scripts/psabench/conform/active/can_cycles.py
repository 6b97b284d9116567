"""Cycles of the parallel bus by object 2002h (docs/reference/protocol_psd1.md, Bus cycles)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from psabench.boards.objects import Common
from psabench.boards.unit import REFUSAL, STROBE_NS
from psabench.conform.bus_host import port
from psabench.conform.capture.bus_cycles import (
    BUS,
    LINES,
    TAIL_S,
    Strobes,
    harmless,
    quiet,
    registers,
    say,
    strobes,
    tell,
)
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.raw_can import ABORT, Nmt, Talk, dialogue, read, words, write
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, Inconclusive, expect

T = TypeVar("T")
DONE, REFUSED = "Bus cycles", "Bus cycles refused"
LONG_NS, LONGEST_NS = 10_000_000, 100_000_000
ADDRESSES = 16  # of the bus: AB0..AB3
SOON_S = 0.002


def _strobe(t: Talk, length_ns: int) -> None:
    t.download(STROBE_NS, 0, length_ns.to_bytes(4, "little"))


def _read(address: int) -> bytes:
    return read(BUS, address + 1)


def _shown(t: Talk, address: int, cycle: Callable[[], T]) -> tuple[T, Strobes]:
    """What comes of a cycle, and the strobes at an address that the lines show meanwhile."""
    with t.s.take() as take:
        answer = cycle()
        t.s.run_for(TAIL_S)
    assert take.lines is not None
    return answer, strobes(take.lines).at(address)


@dialogue("BUS-CYC-01", needs={"can", "pins"}, reset=True)
def an_object_is_a_cycle(t: Talk) -> str:
    """Upload every readable register of 2002h and write one; look at the lines of the bus."""
    told = 0
    t.s.wait_ready()
    where, word = harmless(t.s)
    for address, access in registers(t.s).values():
        if access == "wo":
            continue
        with t.s.take() as take:
            answer = t.ask(_read(address))
            t.s.run_for(TAIL_S)
        if answer[0] == ABORT or take.lines is None:
            continue  # a word that does not wait
        found = strobes(take.lines).at(address)
        value = int.from_bytes(answer[4:6], "little")
        shown = any(found.data[k] == value and not found.write[k] for k in range(len(found)))
        saw = f"{len(found)} strobes at address {address:X}h, none of them a read of {value:04X}h"
        expect(shown, saw, "a strobe with address and word", lines=LINES)
        told += 1
    _, found = _shown(t, where, lambda: t.download(BUS, where + 1, word.to_bytes(2, "little")))
    if len(found) != 1 or not found.write[0] or found.data[0] != word:
        raise Failed(f"{len(found)} strobes at {where:X}h for a write", "one write with its word", lines=LINES)
    return f"{told} reads and a write, each a strobe with its address and word"


@dialogue("BUS-CYC-02", needs={"can", "pins", "exact"}, reset=True)
def a_strobe_is_as_long_as_it_is_set(t: Talk) -> str:
    """Cycles with 2051h at 0, 200, 1234 ns and 1 ms: CS low."""
    told = []
    t.s.wait_ready()
    address = quiet(t.s)
    for length_ns in (0, int(requirements()["BUS-CYC-05"].limit("strobe_min_ns")), 1234, 1_000_000):
        _strobe(t, length_ns)
        _, found = _shown(t, address, lambda: t.upload(BUS, address + 1))
        due = length_ns or int(t.s.variant["strobe_ns"])
        low = (found.rise_ns - found.fall_ns).tolist()
        if low != [due]:
            at = int(found.fall_ns[0]) if len(found) else None
            raise Failed(f"CS low for {low} ns with 2051h = {length_ns}", f"once, {due} ns", at_ns=at, lines=LINES)
        told.append(f"{length_ns}: {due} ns")
    return "; ".join(told)


@dialogue("BUS-CYC-02", "BUS-CYC-03", needs={"can", "stamps"}, reset=True)
def the_answer_waits_for_the_strobe(t: Talk) -> str:
    """A strobe of 10 ms: the time from the answer before to that of the cycle."""
    t.s.wait_ready()
    before = t.answer_to(write(STROBE_NS, 0, LONG_NS.to_bytes(4, "little")))
    after = t.answer_to(_read(quiet(t.s)))
    took_s = after.t_s - before.t_s
    if after.data[0] == ABORT or took_s < LONG_NS * 1e-9 - t.s.slack_s(LONG_NS * 1e-9):
        raise Failed(f"{words(after.data)} {took_s:.6f} s later", f"its word after {LONG_NS * 1e-9} s", frames=[after])
    return f"answered {took_s * 1e3:.3f} ms after the strobe was set to {LONG_NS * 1e-6:g} ms"


@dialogue("BUS-CYC-03", needs={"can", "pins", "lockstep", "stamps"}, reset=True)
def cs_rises_before_the_answer(t: Talk) -> str:
    """A strobe of 1 ms: the rise of CS beside the answer."""
    t.s.wait_ready()
    _strobe(t, 1_000_000)
    answer, found = _shown(t, quiet(t.s), lambda: t.answer_to(_read(quiet(t.s))))
    if len(found) != 1 or answer.t_s * 1e9 < found.rise_ns[0]:
        rise = found.rise_ns.tolist()
        raise Failed(f"CS rises at {rise} ns, the answer ends at {answer.t_s * 1e9:.0f} ns", "CS first", lines=LINES)
    return f"CS rises {answer.t_s * 1e6 - found.rise_ns[0] * 1e-3:.1f} us before the end of the answer"


@dialogue("BUS-CYC-04", reset=True)
def refusals_have_their_codes(t: Talk, row: Requirement) -> str:
    """Cycles at no address, writes to what is read-only, reads of what is write-only: code, counter, text."""
    of = registers(t.s)
    read_only = next(a for a, access in of.values() if access == "ro")
    write_only = next((a for a, access in of.values() if access == "wo"), None)
    wrong = [(write(BUS, read_only + 1, b"\0\0"), "read_only_code")]
    taken = {a for a, _ in of.values()}
    wrong += [(_read(a), "no_address_code") for a in range(ADDRESSES) if a not in taken]
    if write_only is not None:
        wrong.append((_read(write_only), "write_only_code"))
    t.s.wait_ready()
    for request, code in wrong:
        before = t.counter(REFUSED)
        t.refused(request, row.limit(code), f"cycle {words(request[:4])}")
        if t.counter(REFUSED) - before != 1:
            raise Failed(f"{t.counter(REFUSED) - before} refused cycles counted after one", "1")
        expect(t.upload(REFUSAL), "2031h is empty after a refused cycle", "why")
    return f"{len(wrong)} kinds of refusal, each with its code, counted and explained"


@dialogue("BUS-CYC-04", needs={"can", "lockstep"}, reset=True)
def a_word_that_does_not_wait_is_refused(t: Talk, row: Requirement) -> str:
    """Reset node, and the word at address 0 before there is one; no host but one in lockstep is sure to ask so soon."""
    t.s.wait_ready()
    t.reset(Nmt.RESET)
    t.refused(_read(0), row.limit("state_code"), "a word before the first reading")
    return f"refused with {int(row.limit('state_code')):08X}h"


@dialogue("BUS-CYC-05", reset=True)
def a_short_strobe_is_refused(t: Talk, row: Requirement) -> str:
    """2051h one less than the least, a cycle; the least, a cycle."""
    least, code = int(row.limit("strobe_min_ns")), row.limit("abort_code")
    t.s.wait_ready()
    done = t.counter(DONE)
    _strobe(t, least - 1)
    t.refused(_read(quiet(t.s)), code, f"a strobe of {least - 1} ns")
    expect(t.counter(DONE) == done, "a cycle was carried out", "none")
    _strobe(t, least)
    t.upload(BUS, quiet(t.s) + 1)
    return f"{least - 1} ns refused, {least} ns taken"


@active("BUS-CYC-05", needs={"bus"})
def a_short_strobe_is_refused_by_the_port(s: Dut, row: Requirement) -> str:
    """R with a strobe one less than the least, and with the least."""
    least = int(row.limit("strobe_min_ns"))
    answers = say(s, f"R {quiet(s):X} {least - 1}", f"R {quiet(s):X} {least}")
    if not answers[0].startswith("E too-short R") or not answers[1].startswith("R "):
        raise Failed(f"{answers}", "E too-short, then the word")
    return "; ".join(answers)


@dialogue("BUS-CYC-06", needs={"can", "bus"}, reset=True)
def a_second_cycle_is_refused(t: Talk, row: Requirement) -> str:
    """A long cycle over CAN, another by the bus port meanwhile; then the other way round."""
    code = int(row.limit("abort_code"))
    t.s.wait_ready()
    address = quiet(t.s)
    _strobe(t, LONGEST_NS)
    at = len(t.heard)
    t.send(t.sdo_rx, _read(address))
    t.s.run_for(SOON_S)
    answer = say(t.s, f"R {address:X}")[0]
    if any(f.can_id == t.sdo_tx for f in t.heard[at:]):
        raise Inconclusive("the long cycle was over before the other one began")
    expect(answer.startswith("E busy R"), answer, "E busy")
    t.until(lambda: any(f.can_id == t.sdo_tx for f in t.heard[at:]))
    _strobe(t, 0)
    _occupy(t, address)
    found = t.abort_of(_read(address))
    t.s.run_for(1.1 * LONGEST_NS * 1e-9)
    tell(t.s)
    if found != code:
        raise Failed(f"{'a word' if found is None else f'{found:08X}h'} while the port's cycle runs", f"{code:08X}h")
    return f"{answer}; abort {code:08X}h"


def _occupy(t: Talk, address: int) -> None:
    """Let a long cycle of the bus port begin."""
    port(t.s).ask(f"R {address:X} {LONGEST_NS}")
    t.s.run_for(SOON_S)


@dialogue("BUS-CYC-07", needs={"can", "bus"}, reset=True)
def a_reset_cuts_a_cycle(t: Talk) -> str:
    """NMT 81h in a strobe of 100 ms of the bus port: the answer, and a cycle after it."""
    t.s.wait_ready()
    address = quiet(t.s)
    _occupy(t, address)
    t.reset(Nmt.RESET)
    answer = tell(t.s)
    expect(answer.startswith(f"E off R {address:02X}h"), answer, f"E off R {address:02X}h")
    t.s.wait_ready()
    t.upload(BUS, address + 1)
    return f"{answer}; cycles go on"


@dialogue("BUS-CYC-07", needs={"can", "pins"}, reset=True)
def a_cut_cycle_leaves_the_lines_at_rest(t: Talk) -> str:
    """NMT 81h in a strobe of 100 ms: CS."""
    t.s.wait_ready()
    _strobe(t, LONGEST_NS)
    with t.s.take() as take:
        t.send(t.sdo_rx, _read(quiet(t.s)))
        t.s.run_for(SOON_S)
        t.nmt(Nmt.RESET)
        t.s.run_for(SOON_S)
    assert take.lines is not None
    low, high = strobes(take.lines).at(quiet(t.s)), take.lines["CS"].level[-1]
    if not len(low) or not high:
        raise Failed(f"{len(low)} strobes that ended, CS {'high' if high else 'low'} after the reset", "one, CS high")
    return f"CS rises {(low.rise_ns[-1] - low.fall_ns[-1]) * 1e-6:.3f} ms after its fall"


@dialogue("BUS-CYC-08", reset=True)
def other_lengths_are_no_cycle(t: Talk) -> str:
    """1, 3 and 4 bytes to a register that takes a word."""
    row = requirements().rows["BUS-SDO-11"]
    t.s.wait_ready()
    sub = harmless(t.s)[0] + 1
    before = t.counter(DONE)
    for n, code in ((1, "short_code"), (3, "long_code"), (4, "long_code")):
        t.refused(write(BUS, sub, bytes(n)), row.limit(code), f"{n} bytes")
    if t.counter(DONE) != before:
        raise Failed(f"{t.counter(DONE) - before} cycles", "none")
    return "1, 3 and 4 bytes are refused, and no cycle runs"


@dialogue("BUS-CYC-09", reset=True)
def cycles_are_counted(t: Talk) -> str:
    """Five reads and three writes."""
    t.s.wait_ready()
    where, word = harmless(t.s)
    before = t.counter(DONE)
    for _ in range(5):
        t.upload(BUS, quiet(t.s) + 1)
    for _ in range(3):
        t.download(BUS, where + 1, word.to_bytes(2, "little"))
    counted = t.counter(DONE) - before
    expect(counted == 8, f"{counted} cycles counted after 8", "8")
    return "8 of 8"


@dialogue("BUS-CYC-10", reset=True)
def a_strobe_that_is_too_long_is_refused(t: Talk, row: Requirement) -> str:
    """2051h one more than the most, and the most."""
    most = int(row.limit("strobe_max_ns"))
    over = write(STROBE_NS, 0, (most + 1).to_bytes(4, "little"))
    t.refused(over, row.limit("abort_code"), f"{most + 1} ns")
    _strobe(t, most)
    return f"{most} ns taken, {most + 1} ns refused"


@dialogue("BUS-CYC-11", reset=True)
def who_gives_up_finds_the_bus_busy(t: Talk) -> str:
    """Abort a cycle of 100 ms, ask for another at once, and again until the bus is free."""
    code = int(requirements()["BUS-CYC-06"].limit("abort_code"))
    t.s.wait_ready()
    address = quiet(t.s)
    _strobe(t, LONGEST_NS)
    t.send(t.sdo_rx, _read(address))
    t.send(t.sdo_rx, bytes([ABORT]) + _read(address)[1:])
    found = t.abort_of(_read(address))
    expect(found == code, f"{'a word' if found is None else f'{found:08X}h'} right after giving up", f"{code:08X}h")
    t.s.run_for(1.1 * LONGEST_NS * 1e-9)
    _strobe(t, 0)
    t.upload(BUS, address + 1)
    t.ask(read(Common.DEVICE_TYPE))
    return f"abort {code:08X}h meanwhile, free after it"
