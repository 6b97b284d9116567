"""SYNC, communication parameters of TPDOs, history of errors of every board (CiA 301, 7.5.2).

What is due is counted in readings (2030h sub 1), so that no clock of ours checks.
"""

from __future__ import annotations

import itertools

from psabench.boards.objects import Common
from psabench.conform.capture.log import CanFrame, CanLog
from psabench.conform.check.can_frames import number_signal, pdos
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.raw_can import OFF, Nmt, Talk, dialogue, flood, talk, words, write
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect, none_of
from psabench.link.protocol_files import message

READINGS, TIMEOUT_S = 1, 5.0  # sub-index of 2030h
FEW = 4  # readings in which something should come, or nothing
FREE_ID = 0x1F0  # of no service and no message of a node below 112
LONG_ID = 0x800  # the first that 11 bits do not hold
EVENT, SYNC_NEW = 254, 0
INHIBIT_S = 0.05
HISTORY, OVERLOADS = Common.ERROR_HISTORY, 9
FLOOD_S, CALM_S = 0.3, 1.3
LONG, EIGHTHS = {"can", "lockstep", "stream"}, 8  # a round of 16 bits takes minutes of the bench


def _first(t: Talk) -> tuple[int, int]:
    """Object and identifier of the first TPDO that is sent as the board comes."""
    k, can_id = next(iter(t.pdos.items()))
    return Common.TPDO + k - 1, can_id


def _readings(t: Talk, count: int) -> tuple[int, int, int]:
    """Let so many readings be made: how many there were, and what was heard meanwhile, from where to where."""
    begin, at = t.look(Common.COUNTERS, READINGS)
    now, end = begin, at
    for _ in range(2000):
        if now - begin >= count:
            break
        t.s.run_for(0.002)
        now, end = t.look(Common.COUNTERS, READINGS)
    else:
        raise Inconclusive(f"{now - begin} readings in 4 s; expected {count}")
    return now - begin, at, end


def _sent(t: Talk, at: int, can_id: int, end: int | None = None) -> list[CanFrame]:
    return [f for f in t.heard[at:end] if f.can_id == can_id and not f.error]


def _begin(t: Talk, kind: int) -> tuple[int, int]:
    """Ready and operational, the first TPDO with this transmission type, a reading there for it."""
    t.s.wait_ready()
    index, can_id = _first(t)
    t.download(index, 2, bytes([kind]))
    t.nmt(Nmt.START)
    _readings(t, FEW)
    return index, can_id


@dialogue("BUS-SYNC-01")
def syncs_are_counted(t: Talk) -> str:
    """SYNCs without a byte and with a counter of 0, 7 and 255; one of two bytes."""
    before = t.counter("SYNCs")
    for data in (b"", b"\0", b"\7", b"\xff"):
        t.send(t.sync_id, data)
    counted = t.counter("SYNCs") - before
    expect(counted == 4, f"{counted} of 4 SYNCs counted", "4")
    return "4 of 4 counted, whatever their counter"


@active("BUS-SYNC-02", needs={"can", "stream"})
def event_types_send_each_reading(s: Dut) -> str:
    """Transmission types 254 and 255: frames and readings of the same while."""
    told = []
    for kind in (255, EVENT):
        with talk(s, reset=True) as t:
            _, can_id = _begin(t, kind)
            count, at, end = _readings(t, 20)
            came = len(_sent(t, at, can_id, end))
            saw = f"{came} frames {can_id:03X}h of {count} readings with type {kind}"
            expect(abs(came - count) <= 1, saw, f"{count}, give or take 1")
            told.append(f"{kind}: {came} frames, {count} readings")
    return "; ".join(told)


@dialogue("BUS-SYNC-03", needs={"can", "stream"}, reset=True)
def type_0_sends_new_readings_at_sync(t: Talk) -> str:
    """Transmission type 0: no SYNC; one SYNC after a reading; a burst of SYNCs."""
    _, can_id = _begin(t, SYNC_NEW)
    t.fence()
    _silent(t, can_id)
    came = _sent_by(t, can_id, t.after((t.sync_id, b"")))
    expect(came == 1, f"{came} frames at a SYNC after a reading", "1")
    begin = t.number(Common.COUNTERS, READINGS)
    came = _sent_by(t, can_id, t.after(*[(t.sync_id, b"")] * 40))
    count = t.number(Common.COUNTERS, READINGS) - begin
    expect(came <= count + 1, f"{came} frames at 40 SYNCs, while {count} readings were made", f"{count + 1} at most")
    return f"none without SYNC, 1 at a SYNC, {came} at 40 SYNCs and {count} readings"


def _sent_by(t: Talk, can_id: int, frames: list[CanFrame]) -> int:
    """How many of this identifier, those included that still wait for the bus behind the answer."""
    late = [f for f in t.fence() if f.can_id == can_id]
    return len([f for f in frames if f.can_id == can_id]) + len(late)


def _silent(t: Talk, can_id: int) -> None:
    """Raises Failed for a frame while readings are made."""
    count, at, end = _readings(t, FEW)
    came = _sent(t, at, can_id, end)
    expect(not came, f"{len(came)} frames {can_id:03X}h in {count} readings", "none", frames=came)


@dialogue("BUS-SYNC-04", needs={"can", "stream"}, reset=True)
def type_n_sends_at_every_nth_sync(t: Talk) -> str:
    """Transmission types 1, 3 and 240: frames at 6, 9 and 480 SYNCs."""
    told = []
    index, can_id = _begin(t, SYNC_NEW)
    for n, syncs in ((1, 6), (3, 9), (240, 480)):
        t.download(index, 2, bytes([n]))
        _silent(t, can_id)
        came = 0
        for k in range(0, syncs, 30):
            came += _sent_by(t, can_id, t.after(*[(t.sync_id, b"")] * min(30, syncs - k)))
        expect(came == syncs // n, f"{came} frames at {syncs} SYNCs with type {n}", f"{syncs // n}")
        told.append(f"{n}: {came} of {syncs}")
    return "; ".join(told)


@dialogue("BUS-SYNC-05")
def reserved_types_are_refused(t: Talk, row: Requirement) -> str:
    """Write the transmission types 241 to 253."""
    low, high = int(row.limit("type_min")), int(row.limit("type_max"))
    index, _ = _first(t)
    for kind in range(low, high + 1):
        t.refused(write(index, 2, bytes([kind])), row.limit("abort_code"), f"type {kind}")
    return f"{low} to {high} are refused"


@dialogue("BUS-PDO-01", needs={"can", "stream"}, reset=True)
def a_tpdo_that_is_off_is_not_sent(t: Talk, row: Requirement) -> str:
    """Set bit 31 of 18xxh sub 1 while readings are made, and clear it."""
    off = int(row.limit("off_mask"))
    index, can_id = _begin(t, EVENT)
    t.readings(1, can_id)
    cob = t.number(index, 1)
    t.download(index, 1, (cob | off).to_bytes(4, "little"))
    t.fence()
    _silent(t, can_id)
    t.download(index, 1, (cob & ~off).to_bytes(4, "little"))
    t.readings(1, can_id)
    return f"{can_id:03X}h: none with bit 31, and again without"


@dialogue("BUS-PDO-02", needs={"can", "stream"}, reset=True)
def the_identifier_of_a_tpdo(t: Talk, row: Requirement) -> str:
    """Another identifier while it is valid; services, more than 11 bits, RTR; another one while it is off."""
    code = row.limit("abort_code")
    index, can_id = _begin(t, EVENT)
    cob = t.number(index, 1) & ~0x7FF
    t.refused(write(index, 1, (cob | FREE_ID).to_bytes(4, "little")), code, f"{FREE_ID:03X}h while valid")
    t.download(index, 1, (cob | can_id | OFF).to_bytes(4, "little"))
    for service in (t.nmt_id, t.sync_id, t.emcy, t.sdo_tx, t.sdo_rx, t.heartbeat):
        word = (cob | service | OFF).to_bytes(4, "little")
        t.refused(write(index, 1, word), code, f"{service:03X}h")
    for other, what in ((cob | LONG_ID | OFF, "more than 11 bits"), (FREE_ID | OFF, "RTR allowed")):
        t.refused(write(index, 1, other.to_bytes(4, "little")), code, what)
    t.download(index, 1, (cob | FREE_ID | OFF).to_bytes(4, "little"))
    t.download(index, 1, (cob | FREE_ID).to_bytes(4, "little"))
    t.readings(FEW, FREE_ID)
    at = len(t.heard)
    t.readings(FEW, FREE_ID)
    left = _sent(t, at, can_id)
    expect(not left, f"frames {can_id:03X}h after it became {FREE_ID:03X}h", "none", frames=left)
    return f"{can_id:03X}h became {FREE_ID:03X}h; services are refused, and any while it is valid"


@dialogue("BUS-PDO-03", needs={"can", "stamps", "stream"}, reset=True)
def the_inhibit_time_keeps_tpdos_apart(t: Talk, row: Requirement) -> str:
    """An inhibit time of 50 ms: the time between frames, and the count of those left out."""
    unit_s, late_s = row.limit("unit_us") * 1e-6, row.limit("jitter_max_ms") * 1e-3
    index, can_id = _begin(t, EVENT)
    t.download(index, 3, round(INHIBIT_S / unit_s).to_bytes(2, "little"))
    _readings(t, 1)
    sub = next(sub for sub, name in t.s.unit.node.names(Common.COUNTERS).items() if name == "PDOs inhibited")
    looks = [(Common.COUNTERS, READINGS), (Common.COUNTERS, sub), (Common.COUNTERS, READINGS)]
    before = [t.look(*x) for x in looks]
    t.readings(FEW, can_id)
    after = [t.look(*x) for x in looks]
    came = _sent(t, before[1][1], can_id, after[1][1])
    left_out = after[1][0] - before[1][0]
    least, most = after[0][0] - before[2][0], after[2][0] - before[0][0]  # readings, by looks within and around
    apart_s = [b.t_s - a.t_s for a, b in itertools.pairwise(came)]
    if min(apart_s) < INHIBIT_S - t.s.slack_s(INHIBIT_S) - late_s:
        raise Failed(f"{min(apart_s):.6f} s between two frames {can_id:03X}h", f"{INHIBIT_S:g} s and more", frames=came)
    if not least - 2 <= len(came) + left_out <= most + 2:
        raise Failed(f"{len(came)} sent, {left_out} left out of {least} to {most} readings", "each sent or counted")
    return f"{min(apart_s):.6f} s and more apart; of {most} readings {left_out} left out"


@dialogue("BUS-PDO-05", needs=LONG, reset=True)
def numbers_go_on_to_their_modulus(t: Talk) -> str:
    """Let a whole round of numbers pass, an eighth at a time; compare numbers with 2030h:1, which counts on."""
    t.s.wait_ready()
    name, signal = number_signal(t.s.variant.family)
    modulus, can_id = 1 << message(name).get_signal_by_name(signal).length, pdos(t.s.variant.family)[name] + t.node
    base, seen, rate_hz = None, [], _rate_hz(t)
    for _ in range(EIGHTHS + 2):
        before = t.number(Common.COUNTERS, READINGS)
        came = t.stream(FEW, can_id)
        t.hush()
        after = t.number(Common.COUNTERS, READINGS)
        numbers = CanLog(frames=tuple(came)).raw(name)[signal]
        base = before - int(numbers[0]) if base is None else base
        behind = [(after - base - int(n)) % modulus for n in numbers]
        due = f"{before - base} to {after - base} modulo {modulus} as counted in 2030h:1"
        expect(max(behind) <= after - before + 1, f"{signal} {numbers.tolist()}", due, frames=came)
        seen.append(int(numbers[0]))
        t.s.run_for(modulus / EIGHTHS / rate_hz)
    return f"{signal} {', '.join(map(str, seen))} as 2030h:1 counts modulo {modulus}"


def _rate_hz(t: Talk) -> float:
    """Readings a second, as 2030h:1 counts them."""
    before = t.number(Common.COUNTERS, READINGS)
    t.s.run_for(1.0)
    made = t.number(Common.COUNTERS, READINGS) - before
    conclusive(made, "no reading in a second")
    return float(made)


@dialogue("BUS-EMCY-04", needs={"can", "stream"}, reset=True)
def the_history_of_errors(t: Talk) -> str:
    """An overload; 1003h beside the emergency; empty it."""
    told = _overload(t)
    count, latest = t.number(HISTORY), t.upload(HISTORY, 1)
    due = told.data[:2] + bytes([told.data[3], 0])
    if count < 1 or latest != due:
        raise Failed(f"1003h has {count}, the latest {words(latest)}", f"{words(due)}, as the emergency", frames=[told])
    t.download(HISTORY, 0, b"\0")
    if t.number(HISTORY) or any(t.upload(HISTORY, 1)):
        raise Failed("1003h holds emergencies after writing 0 to sub 0", "none")
    return f"{count}, the latest {words(latest)}; none after the write"


@dialogue("BUS-EMCY-04", needs={"can", "lockstep", "stream"}, reset=True)
def the_history_holds_eight(t: Talk, row: Requirement) -> str:
    """Nine overloads, one after the other."""
    most = int(row.limit("history_count"))
    for k in range(OVERLOADS):
        _overload(t)
        if t.number(HISTORY) != min(k + 1, most):
            raise Failed(f"1003h has {t.number(HISTORY)} after {k + 1} emergencies", f"{min(k + 1, most)}")
    empty = [k for k in range(1, most + 1) if not t.number(HISTORY, k)]
    none_of(empty, lambda k: f"1003h:{k} is 0", "an emergency")
    return f"{most} of {OVERLOADS}"


def _overload(t: Talk) -> CanFrame:
    """Samples lost, and the calm after it. Raises Inconclusive where the bus could not be filled."""
    code = int(requirements()["BUS-EMCY-06"].limit("emcy_code"))
    t.s.wait_ready()
    t.nmt(Nmt.START)
    t.fence()
    at = len(t.heard)
    dwell_s = FLOOD_S
    while not _told(t, at, code) and dwell_s < 8 * FLOOD_S:
        flood(t, dwell_s)
        t.s.run_for(0.05)
        dwell_s *= 2.0
    told = _told(t, at, code)
    conclusive(told, f"no emergency {code:04X}h on a bus that others fill")
    t.hush()
    t.s.run_for(CALM_S)
    return told[0]


def _told(t: Talk, at: int, code: int) -> list[CanFrame]:
    return [
        f for f in t.heard[at:] if f.can_id == t.emcy and f.data[:2] == code.to_bytes(2, "little") and len(f.data) == 8
    ]
