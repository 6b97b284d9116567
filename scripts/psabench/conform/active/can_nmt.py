"""Identifiers, boot-up, states and heartbeat of every board (CiA 301, 7.2.8 and 7.3.2)."""

from __future__ import annotations

import itertools

from psabench.boards.board import Setting
from psabench.boards.objects import BusObjects, Common
from psabench.boards.registry import BOARDS
from psabench.conform.dut import Dut
from psabench.conform.raw_can import Nmt, State, Talk, dialogue, ids, read, segment, write
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, expect

BEAT_MS, NEW_BEAT_MS = 20, 100
SETTLE_S = 0.05  # in which a PDO would come, were there one
REQUESTS = 5


def _is(state: int, due: int, what: str) -> None:
    expect(state == due, f"state {state:02X}h {what}", f"{due:02X}h")


def _obeyed(t: Talk, state: int, what: str) -> None:
    expect(t.becomes(state), f"no heartbeat with state {state:02X}h {what}", f"state {state:02X}h")


def _no_pdo(t: Talk, dwell_s: float, what: str) -> None:
    known = set(t.pdos.values())
    came = [f for f in t.during(dwell_s) if f.can_id in known]
    expect(not came, f"{len(came)} PDOs {what}: {ids(came)}", "none", frames=came)


@dialogue("BUS-ID-02")
def it_listens_at_the_identifiers_of_its_node(t: Talk) -> str:
    """Send NMT, SYNC and an SDO request where a unit of this node takes them."""
    before = t.counter("SYNCs")
    t.send(t.sync_id, b"")
    syncs = t.counter("SYNCs") - before
    expect(syncs == 1, f"{syncs} SYNCs counted after one at {t.sync_id:03X}h", "1")
    t.beat(BEAT_MS)
    t.nmt(Nmt.START)
    _obeyed(t, State.OPERATIONAL, f"after a start at {t.nmt_id:03X}h")
    t.nmt(Nmt.PREOP)
    t.beat(1000)
    return f"requests at {t.sdo_rx:03X}h answered, SYNC at {t.sync_id:03X}h counted, NMT at {t.nmt_id:03X}h obeyed"


@dialogue("BUS-ID-03")
def requests_to_another_node_stay_unanswered(t: Talk) -> str:
    """Send SDO requests to the identifiers of other nodes, those that differ in one bit among them."""
    before = [t.counter(c) for c in ("Malformed requests", "Requests refused")]
    nodes = {1, 120, 127, *(t.s.node ^ 1 << bit for bit in range(7))} - {0, t.s.node}  # neighbours differ in one bit
    others = [t.sdo_rx - t.s.node + n for n in sorted(nodes)]
    came = [f for f in t.after(*((other, read(Common.DEVICE_TYPE)) for other in others)) if f.can_id == t.sdo_tx]
    expect(not came, f"{len(came)} answers to requests to other nodes", "none", frames=came)
    moved = [t.counter(c) for c in ("Malformed requests", "Requests refused")]
    expect(moved == before, f"counters {before} became {moved}", "no change")
    return f"silence after requests at {', '.join(f'{i:03X}h' for i in others)}"


@dialogue("BUS-ID-04", needs={"can", "rtr"})
def remote_frames_stay_unanswered(t: Talk) -> str:
    """Ask for its PDO and its heartbeat by remote frames."""
    asked = [*t.pdos.values(), t.heartbeat]
    t.beat(0)
    came = [f for f in t.after(*((i, b"") for i in asked), remote=True) if f.can_id in asked and not f.remote]
    t.beat(1000)
    expect(not came, f"frames {ids(came)} after remote frames", "none", frames=came)
    return f"no answer to remote frames {', '.join(f'{i:03X}h' for i in asked)}"


@dialogue("BUS-BOOT-01", reset=True)
def boot_up_is_the_first_frame(t: Talk, row: Requirement) -> str:
    """Reset node and reset communication: what comes first."""
    for command in (Nmt.RESET, Nmt.RESET_COMMUNICATION):
        t.fence()
        came = [f for f in t.reset(command) if _mine(t, f.can_id)]
        boots = [f for f in came if f.can_id == t.heartbeat and f.data == bytes([int(row.limit("state_code"))])]
        if len(boots) != 1 or came[0] is not boots[0]:
            first = f"{came[0].can_id:03X}h" if came else "nothing"
            raise Failed(
                f"{len(boots)} boot-up messages after NMT {command:02X}h, first of all {first}",
                "one, before anything else",
                frames=came,
            )
    return "one boot-up message, before anything else, after 81h and after 82h"


def _mine(t: Talk, can_id: int) -> bool:
    return can_id in {t.heartbeat, t.emcy, t.sdo_tx, *t.pdos.values()}


@dialogue("BUS-BOOT-01", needs={"can", "supply"})
def boot_up_is_the_first_frame_after_power(t: Talk, row: Requirement) -> str:
    """Switch the supply off and on: what comes first."""
    t.s.bench.supply.output(False)
    t.s.run_for(1.0)
    t.drain()
    at = len(t.heard)
    t.s.bench.supply.output(True)
    t.until(lambda: any(_mine(t, f.can_id) for f in t.heard[at:]), 5.0)
    first = next((f for f in t.heard[at:] if _mine(t, f.can_id)), None)
    if first is None or (first.can_id, first.data) != (t.heartbeat, bytes([int(row.limit("state_code"))])):
        raise Failed(
            f"{ids([first]) if first else 'nothing'} after power-on", "the boot-up message", frames=t.heard[at:]
        )
    t.fence()
    boots = [f for f in t.heard[at:] if f.can_id == t.heartbeat and f.data == bytes([State.BOOT_UP])]
    expect(len(boots) == 1, f"{len(boots)} boot-up messages after power-on", "one", frames=boots)
    return "one boot-up message, before anything else"


@dialogue("BUS-BOOT-02", reset=True)
def it_waits_pre_operational(t: Talk, row: Requirement) -> str:
    """After a reset look at its heartbeat, and for PDOs, until it is set up and longer."""
    t.reset()
    t.beat(BEAT_MS)
    _is(t.state(), int(row.limit("state_code")), "after boot-up")
    _no_pdo(t, 0.3, "before NMT start")
    _is(t.state(), int(row.limit("state_code")), "0.3 s later")
    return "pre-operational, no PDO in 0.3 s"


@dialogue("BUS-NMT-01", needs={"can", "stream"}, reset=True)
def start_makes_it_operational(t: Talk, row: Requirement) -> str:
    """NMT start: the heartbeat and the PDOs."""
    t.beat(BEAT_MS)
    t.nmt(int(row.limit("command_code")))
    _obeyed(t, int(row.limit("state_code")), "after NMT start")
    counts = {i: len(t.readings(1, i)) for i in t.pdos.values()}
    return f"operational, PDOs {', '.join(f'{i:03X}h' for i in counts)}"


@dialogue("BUS-NMT-02", reset=True)
def stop_stops_it(t: Talk, row: Requirement) -> str:
    """NMT stop: the heartbeat."""
    t.beat(BEAT_MS)
    t.nmt(Nmt.START)
    _obeyed(t, State.OPERATIONAL, "after NMT start")
    t.nmt(int(row.limit("command_code")))
    _obeyed(t, int(row.limit("state_code")), "after NMT stop")
    return "stopped"


@dialogue("BUS-NMT-03", needs={"can", "stream"}, reset=True)
def pre_operational_ends_its_pdos(t: Talk, row: Requirement) -> str:
    """NMT start, PDOs, NMT 80h: no PDO after it was obeyed."""
    t.beat(BEAT_MS)
    t.s.wait_ready()
    t.stream()
    t.nmt(int(row.limit("command_code")))
    t.fence()
    _no_pdo(t, 2 * SETTLE_S, "after NMT 80h")
    _is(t.state(), int(row.limit("state_code")), "after NMT 80h")
    return "pre-operational, and no PDO"


def _settings(t: Talk) -> dict[tuple[int, int], bytes]:
    """A value for a communication parameter of each kind, other than its default."""
    return {
        (Common.HEARTBEAT_MS, 0): (777).to_bytes(2, "little"),
        (Common.TPDO, 2): bytes([7]),
        (Common.TPDO, 3): (9).to_bytes(2, "little"),
    }


STROBE = Setting(index=BusObjects.STROBE_NS, sub=0, value=(5000).to_bytes(4, "little"))  # of a board with a bus


def _own_settings(s: Dut) -> dict[tuple[int, int], bytes]:
    """A setting of the board itself; empty for a board that has none."""
    board = BOARDS[s.variant.family]
    own = board.setting or (STROBE if board.bus else None)
    return {(own.index, own.sub): own.value} if own else {}


@dialogue("BUS-NMT-04", reset=True)
def reset_node_restores_the_defaults(t: Talk, row: Requirement) -> str:
    """Write settings, NMT 81h, read them again; count readings before and after."""
    settings = _settings(t) | _own_settings(t.s)
    _write(t, settings)
    t.reset(int(row.limit("command_code")))
    _are_defaults(t, settings, "NMT 81h")
    _is(t.state(), State.PRE_OPERATIONAL, "after NMT 81h")
    return f"{len(settings)} settings have their defaults again"


Settings = dict[tuple[int, int], bytes]


def _write(t: Talk, settings: Settings) -> None:
    """Raises Failed where the board does not keep one."""
    for at, value in settings.items():
        t.download(*at, value)
        if t.upload(*at) != value:
            raise Failed(f"{at[0]:04X}h:{at[1]} does not keep what was written", value[::-1].hex().upper() + "h")


def _are_defaults(t: Talk, settings: Settings, what: str) -> None:
    """Those of the EDS. Raises Failed."""
    for at, written in settings.items():
        due = int(t.s.unit.node.default(*at))
        if t.upload(*at) != due.to_bytes(len(written), "little"):
            raise Failed(f"{at[0]:04X}h:{at[1]} is {t.number(*at)} after {what}", f"{due}")


@dialogue("BUS-NMT-05", reset=True)
def reset_communication_leaves_the_board_alone(t: Talk, row: Requirement) -> str:
    """Write settings of communication and of the board, NMT 82h, read both again; readings go on being counted."""
    t.s.wait_ready()
    own = _own_settings(t.s)
    _write(t, _settings(t) | own)
    count = t.number(Common.COUNTERS, 1)
    t.reset(int(row.limit("command_code")))
    _are_defaults(t, _settings(t), "NMT 82h")
    for (index, sub), written in own.items():
        if t.upload(index, sub) != written:
            raise Failed(f"{index:04X}h:{sub} is {t.number(index, sub)} after NMT 82h", "what was written")
    expect(t.number(Common.COUNTERS, 1) >= count, "the count of readings fell with NMT 82h", "that it goes on")
    kept = ", ".join(f"{index:04X}h:{sub} has what was written" for index, sub in own) or "the board has no settings"
    return f"{len(_settings(t))} communication parameters have their defaults, {kept}"


@dialogue("BUS-NMT-06", reset=True)
def node_0_is_everybody(t: Talk) -> str:
    """NMT commands to node 0 and to another node."""
    t.beat(BEAT_MS)
    other = 1 if t.s.node != 1 else 2
    t.nmt(Nmt.START, other)
    t.nmt(Nmt.STOP, other)
    t.nmt(Nmt.RESET, other)
    t.fence()
    _is(t.state(), State.PRE_OPERATIONAL, f"after commands to node {other}")
    t.nmt(Nmt.START, 0)
    _obeyed(t, State.OPERATIONAL, "after a start of node 0")
    t.nmt(Nmt.PREOP, 0)
    _obeyed(t, State.PRE_OPERATIONAL, "after NMT 80h to node 0")
    t.nmt(Nmt.START, 0)  # others that flowed flow again
    t.nmt(Nmt.PREOP)
    return f"obeys node 0 and itself, not node {other}"


@dialogue("BUS-NMT-07", reset=True)
def unknown_commands_change_nothing(t: Talk) -> str:
    """NMT commands 00h, 03h, 7Fh and FFh, operational and pre-operational."""
    commands = (0x00, 0x03, 0x7F, 0xFF)
    t.beat(BEAT_MS)
    for state, nmt in ((State.PRE_OPERATIONAL, Nmt.PREOP), (State.OPERATIONAL, Nmt.START)):
        t.nmt(nmt)
        t.fence()
        for command in commands:
            t.nmt(command)
            t.fence()
            _is(t.state(), state, f"after NMT command {command:02X}h")
    return "the state stays through each of them"


@dialogue("BUS-NMT-08", reset=True)
def stopped_it_only_beats(t: Talk) -> str:
    """Stopped: SDO requests, SYNCs; then what it says, and what it counted."""
    t.s.wait_ready()
    syncs = t.counter("SYNCs")
    t.beat(BEAT_MS)
    t.nmt(Nmt.START)
    t.nmt(Nmt.STOP)
    _obeyed(t, State.STOPPED, "after NMT stop")
    at = len(t.heard)
    for _ in range(3):
        t.send(t.sync_id, b"")
        t.send(t.sdo_rx, read(Common.DEVICE_TYPE))
    if not t.until(lambda: len([f for f in t.heard[at:] if f.can_id == t.heartbeat]) > 3):
        raise Failed("no heartbeat any more", "one every 20 ms")
    t.nmt(Nmt.PREOP)
    t.fence()
    known = {t.emcy, *t.pdos.values()}
    came = [f for f in t.heard[at:] if f.can_id in known]
    answers = [f for f in t.heard[at:] if f.can_id == t.sdo_tx][:-1]  # the last one is the fence's
    if came or answers:
        raise Failed(f"stopped, and it sent {ids([*came, *answers])}", "heartbeats alone", frames=[*came, *answers])
    counted = t.counter("SYNCs") - syncs
    expect(not counted, f"{counted} SYNCs counted while stopped", "none")
    return "heartbeats alone; no SYNC counted"


@dialogue("BUS-NMT-09", reset=True)
def a_stop_ends_a_transfer(t: Talk, row: Requirement) -> str:
    """Begin a segmented upload, stop, go pre-operational, ask for the next segment."""
    code = int(row.limit("abort_code"))
    t.ask(read(Common.DEVICE_NAME))
    t.nmt(Nmt.STOP)
    t.nmt(Nmt.PREOP)
    found = t.abort_of(segment(0))
    if found != code:
        saw = "a segment" if found is None else f"abort {found:08X}h"
        raise Failed(f"{saw} after the stop", f"abort {code:08X}h")
    return f"abort {code:08X}h"


@dialogue("BUS-NMT-10")
def requests_are_answered_in_both_states(t: Talk) -> str:
    """Upload 1000h pre-operational and operational."""
    for nmt in (Nmt.PREOP, Nmt.START):
        t.nmt(nmt)
        for _ in range(REQUESTS):
            t.upload(Common.DEVICE_TYPE)
    t.hush()
    return f"{REQUESTS} answers in each state"


@dialogue("BUS-HB-02", reset=True)
def no_heartbeat_where_the_period_is_0(t: Talk, row: Requirement) -> str:
    """1017h = 0, then look for heartbeats."""
    t.beat(0)
    came = [f for f in t.during(row.limit("quiet_s")) if f.can_id == t.heartbeat]
    expect(not came, f"{len(came)} heartbeats with 1017h = 0", "none", frames=came)
    return f"none in {row.limit('quiet_s'):g} s"


@dialogue("BUS-HB-03", needs={"can", "stamps"}, reset=True)
def a_new_period_holds_at_once(t: Talk, row: Requirement) -> str:
    """Write 100 ms to 1017h and take the time of the next heartbeats."""
    late_s = row.limit("jitter_max_ms") * 1e-3
    period_s = NEW_BEAT_MS * 1e-3
    written = t.answer_to(write(Common.HEARTBEAT_MS, 0, NEW_BEAT_MS.to_bytes(2, "little")))
    beats = [t.next(t.heartbeat), t.next(t.heartbeat)]
    came = [written, *(b for b in beats if b is not None)]
    expect(len(came) >= 3, f"{len(came) - 1} heartbeats with a period of {NEW_BEAT_MS} ms", "one in each")
    for a, b in itertools.pairwise(came):
        off_s = b.t_s - a.t_s - period_s
        saw = f"a heartbeat {b.t_s - a.t_s:.6f} s after the one before or the write"
        expect(abs(off_s) <= late_s + t.s.slack_s(period_s), saw, f"{period_s} s", frames=came)
    return f"{', '.join(f'{(b.t_s - a.t_s) * 1e3:.3f}' for a, b in itertools.pairwise(came))} ms apart"
