"""What any log of a board's frames must show: identifiers, boot-up, heartbeats, answers, emergencies, order of PDOs."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import numpy as np

from psabench.boards.devices import of_board
from psabench.conform.capture.canbits import frame_bits
from psabench.conform.capture.log import CanFrame, Capture
from psabench.conform.plan import check
from psabench.conform.profile import proto_yaml
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, Inconclusive, conclusive, damaged_data_are, expect, none_of
from psabench.link.protocol_files import database, dbc_node, message
from psabench.link.signals import unwrap

SERVICES = ("EMCY", "SDO_TX", "SDO_RX", "HEARTBEAT")
HEARTBEAT_TIME = bytes([0x17, 0x10, 0])  # index and sub-index as on the wire
TIMED_OUT = bytes([0, 0, 4, 5])  # abort of a transfer whose client is silent: it answers no request
PPM = 1e-6
BIT_S = 1e-6  # of a bus of 1 Mbit/s
PASSIVE_ERRORS, OFF_ERRORS = 16, 32  # error frames that bring TEC over 127 and 255, 8 each (ISO 11898-1, 12.1.4)


@cache
def pdos(board: str) -> dict[str, int]:
    """Messages of a board with their identifiers at node 0, in the order of its TPDOs."""
    names = [str(m.name) for m in database().messages if board.upper() in m.senders[:1]]
    mine = [n for n in names if not n.endswith(SERVICES) and n not in ("NMT", "SYNC")]
    order = [str(t["message"]) for t in _yaml(board)["tpdos"]]
    return {n: int(message(n).frame_id) - dbc_node(board) for n in sorted(mine, key=order.index)}


@cache
def _yaml(board: str) -> Any:
    name = "psabench.yaml" if board == "psa2" else f"{board}.yaml"
    return proto_yaml(name)


@cache
def emergencies(board: str) -> dict[int, int]:
    """Codes of a board's emergencies and the bits that each has in the error register."""
    common = [e for e in _yaml("psa2")["emcy"] if e["code"] < 0xFF00 or e["name"] == "STREAM_REFUSED"]
    return {int(e["code"]): int(e["register"]) for e in [*common, *_yaml(board).get("emcy", [])]}


def _id(e: Capture, name: str) -> int:
    return int(requirements().rows["BUS-ID-01"].limit(f"{name}_id")) + e.node


def _mine(e: Capture) -> tuple[CanFrame, ...]:
    """Frames that this unit sent: all of the log with an identifier of its own. Raises Inconclusive for none."""
    own = {_id(e, n) for n in ("emcy", "sdo_tx", "heartbeat")} | {i + e.node for i in pdos(e.variant.family).values()}
    found = tuple(f for f in e.can.frames if f.can_id in own and not f.error and not f.sent)
    conclusive(found, "no frame of this node in the log")
    return found


@check("services", "BUS-ID-01", needs={"can", "stream"})
def frames_have_the_identifiers_of_the_node(e: Capture) -> str:
    """Look at the identifiers of all frames that belong to the node."""
    mine = {f.can_id for f in _mine(e)}
    services = {_id(e, "sdo_tx"): "SDO answers", _id(e, "heartbeat"): "heartbeat"}
    missing = [what for can_id, what in services.items() if can_id not in mine]
    stray = [f for f in e.can.frames if _is_stray(e, f)]
    none_of(stray, lambda f: f"a frame {f.can_id:03X}h, which is no message of the unit", "its own", frames=stray)
    conclusive(not missing, f"not in the log: {', '.join(missing)}")
    if not mine & {i + e.node for i in pdos(e.variant.family).values()}:
        raise Failed(f"frames {', '.join(f'{i:03X}h' for i in sorted(mine))}", "TPDOs at the identifiers of the page")
    return f"frames {', '.join(f'{i:03X}h' for i in sorted(mine))}"


def _is_stray(e: Capture, f: CanFrame) -> bool:
    """Of this node by the predefined connection set, and nothing that a unit or a host of it sends."""
    if f.error or f.sent or f.extended or f.can_id & 0x7F != e.node:
        return False
    known = {_id(e, n) for n in ("emcy", "sdo_tx", "heartbeat")} | {i + e.node for i in pdos(e.variant.family).values()}
    request = int(requirements().rows["BUS-ID-02"].limit("sdo_rx_id")) + e.node
    return f.can_id not in known | {request} and f.can_id > 0x7F


@check("services", "BUS-ID-04", needs={"can", "rtr"})
def no_remote_frames(e: Capture) -> str:
    """Look for remote frames of the unit."""
    bad = [f for f in _mine(e) if f.remote]
    none_of(bad, lambda f: f"a remote frame {f.can_id:03X}h", "data frames", frames=bad)
    return f"{len(_mine(e))} data frames"


@check("services", "BUS-ID-05")
def identifiers_have_11_bits(e: Capture) -> str:
    """Look for frames with identifiers of 29 bits."""
    bad = [f for f in e.can.frames if f.extended and not f.error and not f.sent]
    none_of(bad, lambda f: f"a frame {f.can_id:08X}h", "11 bits", frames=bad)
    return f"{len(_mine(e))} frames of the unit with 11 bits"


@check("services", "BUS-ID-06", needs={"can", "fd"})
def services_are_classic(e: Capture) -> str:
    """Look at the form of boot-up, heartbeat, emergencies and SDO answers."""
    ids = {_id(e, n) for n in ("emcy", "sdo_tx", "heartbeat")}
    mine = [f for f in _mine(e) if f.can_id in ids]
    bad = [f for f in mine if f.fd]
    none_of(bad, lambda f: f"an FD frame {f.can_id:03X}h", "a classic one", frames=bad)
    return f"{len(mine)} classic frames"


@check("services", "BUS-BOOT-01")
def state_0_is_said_once(e: Capture, row: Requirement) -> str:
    """Count boot-up messages, and look at what came before."""
    state = bytes([int(row.limit("state_code"))])
    beats = [f for f in _mine(e) if f.can_id == _id(e, "heartbeat")]
    boots = [f for f in beats if f.data == state]
    expect(not any(len(f.data) != 1 for f in beats), "a heartbeat of other than one byte", "one byte", frames=beats)
    if "reset" in e.marks and len(boots) != 1:
        raise Failed(f"{len(boots)} boot-up messages after a reset", "one", frames=beats)
    conclusive(boots, "no boot-up in the log")
    return f"{len(boots)} boot-up messages of one byte"


@check("services", "BUS-HB-01", needs={"can", "stamps"})
def heartbeats_keep_their_period(e: Capture, row: Requirement) -> str:
    """Measure the intervals between heartbeats, until a write to 1017h."""
    due_s, late_s = row.limit("default_ms") * 1e-3, row.limit("jitter_max_ms") * 1e-3
    beats: list[CanFrame] = []
    for f in e.can.frames:
        if f.can_id == _id(e, "heartbeat") and not f.error:
            beats.append(f)
        elif f.data[1:4] == HEARTBEAT_TIME and f.data[0] & 0xE0 == 0x20:
            break
    t_s = np.array([f.t_s for f in beats])
    keep = np.array([f.data != b"\0" for f in beats[1:]], bool)  # from one to a boot-up there is no period
    apart_s = np.diff(t_s)[keep] if len(t_s) > 1 else t_s[:0]
    conclusive(len(apart_s) >= 2, f"{len(apart_s)} intervals between heartbeats; expected 2")
    off_s = np.abs(apart_s - due_s)
    if off_s.max() > late_s + due_s * e.clock_ppm * PPM:
        worst = float(apart_s[off_s.argmax()])
        raise Failed(f"{worst:.6f} s between heartbeats", f"{due_s:g} s +- {late_s * 1e3:g} ms", frames=beats)
    return f"{len(apart_s)} intervals of {apart_s.min():.6f} to {apart_s.max():.6f} s"


@check("services", "BUS-SDO-15")
def requests_and_answers_take_turns(e: Capture) -> str:
    """Pair each SDO request of the log with the answer that follows it."""
    request_id = int(requirements().rows["BUS-ID-02"].limit("sdo_rx_id")) + e.node
    waiting: list[CanFrame] = []
    answered = 0
    for f in (f for f in e.can.frames if not f.error):
        if f.can_id == request_id and len(f.data) == 8 and f.data[0] != 0x80:
            waiting.append(f)
        elif f.can_id == _id(e, "sdo_tx") and not f.sent and f.data[4:8] != TIMED_OUT:
            expect(waiting or not answered, "an SDO answer without a request", "one for each", frames=[f])
            if waiting:
                _belongs(waiting.pop(0), f)
                answered += 1
    expect(len(waiting) <= 1, f"{len(waiting)} requests without an answer", "one each", frames=waiting)
    conclusive(answered >= 2, f"{answered} SDO requests with their answers in the log")
    return f"{answered} requests, each with its answer"


def _belongs(request: CanFrame, answer: CanFrame) -> None:
    """Raises Failed where an answer names another object; segments name none."""
    names = answer.data[:1] and answer.data[0] & 0xE0 in (0x40, 0x60, 0x80) and request.data[0] & 0xE0 in (0x20, 0x40)
    if len(answer.data) != 8 or (names and answer.data[1:4] != request.data[1:4]):
        raise Failed(f"{answer.data.hex(' ')} to {request.data.hex(' ')}", "its object", frames=[request, answer])


# ---- emergencies


def _told(e: Capture) -> list[CanFrame]:
    """Raises Inconclusive where the log has none, Failed for one of another length."""
    told = list(e.can.of_id(_id(e, "emcy")).frames)
    conclusive(told, "no emergency in the log")
    size = int(row_for(e, "BUS-EMCY-01").limit("data_bytes"))
    expect(not any(len(f.data) != size for f in told), "an emergency of other than 8 bytes", "8 bytes", frames=told)
    return told


def code_of(f: CanFrame) -> int:
    """Of an emergency."""
    return int.from_bytes(f.data[:2], "little")


def stamp_s(e: Capture, f: CanFrame) -> float:
    """The device's time in an emergency."""
    return float(int.from_bytes(f.data[4:8], "little") * row_for(e, "BUS-EMCY-01").limit("unit_us") * 1e-6)


@check("overload", "BUS-EMCY-01", needs={"can", "stream"})
def emergencies_have_their_form(e: Capture) -> str:
    """Look at length, error register and time of each emergency."""
    told = _told(e)
    for f in told:
        saw = f"error register {f.data[2]:02X}h with code {code_of(f):04X}h"
        expect(bool(f.data[2]) == bool(code_of(f)), saw, "0 with 0000h only", frames=[f])
    times = [stamp_s(e, f) for f in told]
    expect(not any(b < a for a, b in itertools.pairwise(times)), f"times {times}", "that they rise", frames=told)
    t_s = [f.t_s - t for f, t in zip(told, times, strict=True)]
    return f"{len(told)} emergencies, {max(t_s) - min(t_s):.3f} s between their times and those of the log"


@check("overload", "BUS-EMCY-02", needs={"can", "stream"})
def a_condition_is_told_once(e: Capture) -> str:
    """Count the emergencies of each condition."""
    lasting: set[int] = set()
    told = _told(e)
    for f in told:
        code = code_of(f)
        expect(code not in lasting, f"{code:04X}h a second time before 0000h", "once", frames=told)
        lasting = set() if code == 0 else lasting | {code}
    return f"{', '.join(f'{code_of(f):04X}h' for f in told)}"


@check("overload", "BUS-EMCY-03", needs={"can", "stream"})
def the_end_is_told_once(e: Capture, row: Requirement) -> str:
    """Look at the emergency that ends the last condition."""
    told = _told(e)
    due = int(row.limit("emcy_code"))
    ends = [k for k, f in enumerate(told) if code_of(f) == due]
    if any(k == 0 or code_of(told[k - 1]) == due for k in ends):
        raise Failed("0000h without a condition before it", "once, after the last one has ended", frames=told)
    expect(not any(any(told[k].data[2:3]) for k in ends), "0000h with an error register", "00h", frames=told)
    if not ends:
        raise (Failed("no 0000h", "one", frames=told) if "flood" in e.marks else Inconclusive("no condition has ended"))
    return f"{len(ends)} times 0000h, register 00h"


@check("overload", "BUS-EMCY-05", needs={"can", "stream"})
def codes_are_of_the_table(e: Capture) -> str:
    """Look each emergency up in the table of codes."""
    table, told = emergencies(e.variant.family), _told(e)
    lasting: set[int] = set()
    for f in told:
        code, register = code_of(f), f.data[2]
        if code and code not in table:
            raise Failed(f"code {code:04X}h", f"one of {', '.join(f'{c:04X}h' for c in table)}", frames=[f])
        lasting = set() if code == 0 else lasting | {code}
        if code and (register & table[code]) != table[code]:
            raise Failed(f"{code:04X}h with error register {register:02X}h", f"{table[code]:02X}h", frames=[f])
        if register & ~_any(table[c] for c in lasting) & 0xFF and "flood" in e.marks:
            raise Failed(f"error register {register:02X}h", f"bits of {[hex(c) for c in lasting]}", frames=[f])
    return f"{len(told)} emergencies of the table"


def _any(bits: Any) -> int:
    found = 0
    for b in bits:
        found |= b
    return found


@check("overload", "BUS-EMCY-06", needs={"can", "stream"})
def lost_samples_are_told(e: Capture, row: Requirement) -> str:
    """Compare what is missing in the numbers of the readings with the counter, and the emergencies with both."""
    conclusive("dropped" in e.facts, "the counter was not read")
    missing = int((np.diff(_numbers(e)) - 1).sum())
    if missing != e.facts["dropped"]:
        raise Failed(f"{missing} readings missing, {e.facts['dropped']} counted as dropped", "the same")
    told = _told(e)
    begin = [f for f in told if code_of(f) == int(row.limit("emcy_code"))]
    expect(begin, f"no {int(row.limit('emcy_code')):04X}h", "one", frames=told)
    after = [f for f in told[told.index(begin[-1]) + 1 :] if code_of(f) == 0]
    expect(after, "the condition does not end", f"0000h {row.limit('ends_s'):g} s after the last loss", frames=told)
    lasted_s = stamp_s(e, after[0]) - stamp_s(e, begin[-1])
    if lasted_s < row.limit("ends_s") * (1 - e.clock_ppm * PPM):
        raise Failed(f"over after {lasted_s:.6f} s", f"{row.limit('ends_s'):g} s without a loss", frames=told)
    return f"{missing} readings lost, all counted; told, and over {lasted_s:.3f} s later"


@cache
def number_signal(family: str) -> tuple[str, str]:
    """The message and the signal that number a board's readings."""
    counter = "SEQ" if family == "psa2" else of_board(family).layout.counter
    return next(n for n in pdos(family) if counter in message(n).signal_tree), counter


def _numbers(e: Capture) -> np.ndarray:
    """Numbers (n,) of the readings of the log, unwrapped. Raises Inconclusive, and Failed for other lengths."""
    name, counter = number_signal(e.variant.family)
    frames = e.frames_of(name)
    conclusive(len(frames) >= 2, f"{len(frames)} frames {name} in the log")
    with damaged_data_are(Failed, "frames of the DBC's length"):
        raw = frames.raw(name)[counter]
    return unwrap(raw, message(name).get_signal_by_name(counter).length)


@check("overload", "BUS-PDO-04", needs={"can", "stream"})
def frames_of_a_sample_keep_their_order(e: Capture) -> str:
    """Look at the order of the frames of each sample, before, while and after others fill the bus."""
    order = [i + e.node for i in pdos(e.variant.family).values()]
    came = [f for f in e.can.frames if f.can_id in order and not f.error and not f.sent]
    used = [i for i in order if any(f.can_id == i for f in came)]
    conclusive(len(came) >= 2 * len(used) and came, f"{len(came)} PDOs in the log")
    for a, b in itertools.pairwise(came):
        due = used[(used.index(a.can_id) + 1) % len(used)]
        expect(b.can_id == due, f"{b.can_id:03X}h after {a.can_id:03X}h", f"{due:03X}h", frames=[a, b])
    return f"{len(came)} frames in the order {', '.join(f'{i:03X}h' for i in used)}"


@check("overload", "BUS-LOAD-02", needs={"can", "lockstep", "stream"})
def no_more_than_its_queue_waits(e: Capture, row: Requirement) -> str:
    """Count the readings that were kept when the bus was filled: those that come before the gap in the numbers."""
    conclusive("flood" in e.marks, "no node filled the bus")
    most = int(row.limit("queue_frames"))
    order = {i + e.node for i in pdos(e.variant.family).values()}
    at = int(e.marks["flood"])
    used = len({f.can_id for f in e.can.frames if f.can_id in order})
    before = len([f for f in e.can.frames[:at] if f.can_id in order and not f.error and not f.sent]) // max(1, used)
    numbers = _numbers(e)
    gaps = np.flatnonzero(np.diff(numbers) > 1)
    conclusive(len(gaps), "no reading was lost")
    kept = int(gaps[gaps >= before - 1][0]) + 1 - before if (gaps >= before - 1).any() else 0
    if kept > most // used + 1:
        raise Failed(f"{kept} readings of {used} frames waited", f"{most} frames at most, and one under way")
    return f"{kept} readings of {used} frames waited, {len(gaps)} gaps of whole readings"


# ---- the CAN controller, where frames were destroyed


@check("errors", "BUS-EMCY-07", needs={"can", "errors"})
def error_passive_is_told(e: Capture, row: Requirement) -> str:
    """Look for the emergency after enough error frames, and for its end."""
    told = list(e.can.of_id(_id(e, "emcy")).frames)
    code = int(row.limit("emcy_code"))
    begin = next((f for f in told if code_of(f) == code), None)
    errors = [f for f in e.can.frames if f.error]
    if begin is None:
        if len(errors) < PASSIVE_ERRORS:
            raise Inconclusive(
                f"{len(errors)} error frames in the log; {PASSIVE_ERRORS} in a row make a unit error-passive"
            )
        raise Failed(f"{len(errors)} error frames, and no {code:04X}h", "one", frames=told)
    first = [f for f in e.can.frames[: e.can.frames.index(begin)] if f.error]
    if len(first) < PASSIVE_ERRORS:
        raise Failed(f"{code:04X}h after {len(first)} error frames", f"{PASSIVE_ERRORS} and more", frames=[begin])
    expect(any(code_of(f) == 0 for f in told[told.index(begin) :]), f"no 0000h after {code:04X}h", "one", frames=told)
    return f"{code:04X}h after {len(first)} error frames, and 0000h"


@check("errors", "BUS-EMCY-08", "BUS-EMCY-09", needs={"can", "errors"})
def coming_back_to_the_bus_is_told(e: Capture) -> str:
    """Look for the emergency of a unit that comes back, how long it was away, and that it ends at once."""
    told, code = _told(e), int(row_for(e, "BUS-EMCY-08").limit("emcy_code"))
    back = next((f for f in told if code_of(f) == code), None)
    if back is None:
        raise Inconclusive(f"no {code:04X}h in the log; {OFF_ERRORS} error frames in a row put a unit off the bus")
    at = e.can.frames.index(back)
    last = next((f for f in reversed(e.can.frames[:at]) if f.error), None)
    if last is None:
        raise Failed(f"{code:04X}h without an error frame", "after bus-off", frames=[back])
    away_bits = (back.t_s - last.t_s) / BIT_S - frame_bits(back.can_id, back.data)
    least = row_for(e, "BUS-EMCY-09").limit("recessive_bits")
    expect(away_bits >= least, f"back after {away_bits:.0f} bits", f"{least} and more", frames=[last, back])
    after = told[told.index(back) + 1 :]
    expect(after and code_of(after[0]) == 0, f"no 0000h right after {code:04X}h", "one", frames=told)
    return f"back after {away_bits:.0f} bits; {code:04X}h, then 0000h"


@check("slow_bus", "BUS-EMCY-10", needs={"can", "slow"})
def a_stream_that_does_not_fit_stands(e: Capture, row: Requirement) -> str:
    """Look for PDOs between the emergency of a stream that does not fit and its end."""
    told, code = _told(e), int(row.limit("emcy_code"))
    begin = next((f for f in told if code_of(f) == code), None)
    if begin is None:
        raise Inconclusive(f"no {code:04X}h in the log")
    order = {i + e.node for i in pdos(e.variant.family).values()}
    for f in e.can.frames[e.can.frames.index(begin) + 1 :]:
        if f.can_id == _id(e, "emcy") and code_of(f) == 0:
            break
        if f.can_id in order and not f.error:
            raise Failed(f"a PDO {f.can_id:03X}h after {code:04X}h", "none until it fits", frames=[begin, f])
    return f"no PDO after {code:04X}h"
