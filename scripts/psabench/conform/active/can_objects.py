"""The object dictionary that all boards have in common, load and counters (docs/reference/protocol.md, Objects)."""

from __future__ import annotations

from psabench.boards.objects import Common
from psabench.boards.unit import tpdo_numbers
from psabench.conform.active.can_sdo import NOWHERE, put
from psabench.conform.capture.canbits import frame_bits
from psabench.conform.dictionary import encoded
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.raw_can import LEAST, Nmt, Talk, dialogue, read, talk, words
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect
from psabench.link.canopen_host import Described
from psabench.link.protocol_files import message

COMMON = (
    Common.DEVICE_TYPE,
    Common.ERROR_REGISTER,
    Common.ERROR_HISTORY,
    Common.COB_ID_SYNC,
    Common.DEVICE_NAME,
    Common.HARDWARE_VERSION,
    Common.SOFTWARE_VERSION,
    Common.COB_ID_EMCY,
    Common.HEARTBEAT_MS,
    Common.IDENTITY,
    Common.SDO_SERVER_PARAMETER,
)
LOAD = "Bus load"
SERIAL = 4
NEAR = 3  # readings before and after an answer that it may be of
ERRORS_OF_CAN = ("Transmit errors", "Receive errors", "Controller state")
LOAD_S = 1.0
READINGS, SOME_S = 1, 0.1  # sub-index of 2030h; some of them
SPACE_BITS = 3  # interframe space (ISO 11898-1, 10.4.6)


def _common(o: Described) -> bool:
    return (
        o.index in COMMON
        or Common.TPDO <= o.index < Common.TPDO + 8
        or Common.TPDO_MAPPING <= o.index < Common.TPDO_MAPPING + 8
    )


@dialogue("BUS-OD-01", reset=True)
def the_common_objects_are_there(t: Talk) -> str:
    """After a reset upload every communication object: its length, its default."""
    seen = 0
    t.reset()
    for o in filter(_common, t.s.unit.node.objects()):
        value = t.upload(o.index, o.sub)
        what = f"{o.index:04X}h:{o.sub}"
        expect(o.data_bytes is None or len(value) == o.data_bytes, f"{what} has {len(value)} bytes", f"{o.data_bytes}")
        due = _due(o)
        if due is not None and value != due:
            raise Failed(f"{what} is {words(value)}", words(due))
        seen += 1
    return f"{seen} objects with their types and defaults"


def _due(o: Described) -> bytes | None:
    """Value after a reset; None: the EDS cannot know it (serial number, state of errors)."""
    return None if o.access == "ro" or o.default is None else encoded(o, o.default)


@dialogue("BUS-OD-02")
def device_type(t: Talk, row: Requirement) -> str:
    """Upload 1000h."""
    due = int(row.limit("device_type"))
    found = t.upload(Common.DEVICE_TYPE)
    expect(found == due.to_bytes(4, "little"), words(found), f"{due:X}h in 4 bytes")
    return f"{due:X}h"


@dialogue("BUS-OD-03", reset=True)
def serial_number(t: Talk) -> str:
    """Upload 1018h sub 4 before and after a reset."""
    before = t.upload(Common.IDENTITY, SERIAL)
    t.reset()
    after = t.upload(Common.IDENTITY, SERIAL)
    expect(before == after and len(before) == 4, f"{words(before)}, after a reset {words(after)}", "the same 4 bytes")
    return f"serial number {int.from_bytes(before, 'little')}"


@dialogue("BUS-OD-04", needs={"can", "stream"}, reset=True)
def constants_name_the_node(t: Talk) -> str:
    """Upload the objects that name an identifier, and see that it is the one in use."""
    t.reset()
    due = {
        (Common.COB_ID_EMCY, 0): t.emcy,
        (Common.SDO_SERVER_PARAMETER, 1): t.sdo_rx,
        (Common.SDO_SERVER_PARAMETER, 2): t.sdo_tx,
    }
    due |= {(Common.TPDO + k - 1, 1): can_id for k, can_id in t.pdos.items()}
    for (index, sub), can_id in due.items():
        found = t.number(index, sub) & 0x7FF
        expect(found == can_id, f"{index:04X}h:{sub} names {found:03X}h", f"{can_id:03X}h")
    t.s.wait_ready()
    for can_id in t.pdos.values():
        t.stream(1, can_id)
    return f"{len(due)} objects name the identifiers of node {t.s.node}"


@dialogue("BUS-OD-05", reset=True)
def the_remark_outlives_a_reset(t: Talk) -> str:
    """Write 2040h, NMT 81h, read it."""
    put(t, Common.REMARK, b"kept over Res")
    t.reset()
    found = t.upload(Common.REMARK)
    put(t, Common.REMARK, b"")
    expect(found == b"kept over Res", f"{found!r} after a reset", "what was written")
    return "kept"


@dialogue("BUS-OD-05", needs={"can", "supply"})
def the_remark_goes_with_the_power(t: Talk) -> str:
    """Write 2040h, switch the supply off and on, read it."""
    put(t, Common.REMARK, b"gone with the power")
    power_cycle(t)
    found = t.upload(Common.REMARK)
    expect(not found, f"{found!r} after power-on", "nothing")
    return "forgotten"


def power_cycle(t: Talk) -> None:
    """Off, on, until the board boots up. Raises Inconclusive when it does not."""
    t.s.bench.supply.output(False)
    t.s.run_for(1.0)
    t.drain()
    at = len(t.heard)
    t.s.bench.supply.output(True)
    if not t.until(lambda: any(f.can_id == t.heartbeat and f.data == b"\0" for f in t.heard[at:]), 5.0):
        raise Inconclusive("no boot-up message within 5 s of power-on")


@dialogue("BUS-OD-06", reset=True)
def mappings_lay_out_the_messages(t: Talk) -> str:
    """Upload each mapping and lay it beside the DBC; try to write it."""
    code = requirements().rows["BUS-SDO-10"].limit("read_only_code")
    node, told = t.s.unit.node, []
    for k in tpdo_numbers(node):
        name = node.title(Common.TPDO + k).partition(":")[0]
        count = t.number(Common.TPDO_MAPPING + k)
        entries = [t.number(Common.TPDO_MAPPING + k, sub) for sub in range(1, min(count, 64) + 1)]
        t.refused(_write_one(Common.TPDO_MAPPING + k), code, f"a write to {Common.TPDO_MAPPING + k:04X}h:1")
        if not node.default(Common.TPDO_MAPPING + k, 0):
            continue  # of no object: the DBC alone has the layout (docs/reference/protocol.md, Objects)
        bits = sum(e & 0xFF for e in entries)
        saw = f"{Common.TPDO_MAPPING + k:04X}h maps {bits} bits"
        expect(bits == 8 * int(message(name).length), saw, f"{8 * int(message(name).length)}, as {name} has")
        _bounds(name, entries)
        told.append(name)
    return f"{', '.join(told)} as mapped; no mapping is written"


def _write_one(index: int) -> bytes:
    return bytes([0x23]) + index.to_bytes(2, "little") + b"\0" + bytes(4)


def _bounds(name: str, entries: list[int]) -> None:
    """Each mapped object begins where a signal does, or holds none (several flags may share one object)."""
    spans = [range(int(x.start), int(x.start + x.length)) for x in message(name).signals]
    at = 0
    for entry in entries:
        inside = [x for x in spans if at in x and at != x.start]
        expect(not inside, f"{name} maps {entry >> 16:04X}h at bit {at}", "at the begin of a signal")
        at += entry & 0xFF


@dialogue("BUS-OD-07", "BUS-ID-07", needs={"can", "stream"}, reset=True)
def mapped_objects_read_as_the_frames(t: Talk) -> str:
    """While PDOs come upload all that they map; find each value in a frame that came just before or after."""
    compared = 0
    t.s.wait_ready()
    for k, can_id in t.pdos.items():
        mapping = [
            t.number(Common.TPDO_MAPPING + k - 1, sub)
            for sub in range(1, min(t.number(Common.TPDO_MAPPING + k - 1), 64) + 1)
        ]
        t.stream(LEAST, can_id)
        at = 0
        for entry in mapping:
            _compare(t, can_id, entry, at)
            at += entry & 0xFF
            compared += 1
        t.hush()
    conclusive(compared, "no PDO with a mapping")
    return f"{compared} mapped objects are what the frames carried"


def _compare(t: Talk, can_id: int, entry: int, at: int) -> None:
    index, sub, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
    value, place = t.look(index, sub)
    found = value & (1 << bits) - 1
    before = [f for f in t.heard[:place] if f.can_id == can_id and not f.error][-NEAR:]
    near = before + t.readings(NEAR, can_id, at=place)[:NEAR]
    due = {int.from_bytes(f.data, "little") >> at & (1 << bits) - 1 for f in near}
    expect(
        found in due,
        f"{index:04X}h:{sub} is {found:X}h",
        f"bits {at} to {at + bits - 1} of a frame {can_id:03X}h just before or after: "
        + ", ".join(f"{d:X}h" for d in sorted(due)),
        frames=near,
    )


@dialogue("BUS-CNT-01", reset=True)
def counters_outlive_a_reset(t: Talk) -> str:
    """Refusals and SYNCs, NMT 81h, the counters again; the readings, which go on, are not less."""
    names = ("Requests refused", "Malformed requests", "SYNCs")
    t.s.wait_ready()
    t.s.run_for(SOME_S)
    t.ask(read(NOWHERE))
    t.send(t.sdo_rx, b"\0")
    t.send(t.sync_id, b"")
    before, readings = [t.counter(n) for n in names], t.number(Common.COUNTERS, READINGS)
    t.reset(Nmt.RESET)
    after, later = [t.counter(n) for n in names], t.number(Common.COUNTERS, READINGS)
    expect(later >= readings, f"{readings} readings, {later} after NMT 81h", "as many or more")
    expect(after == before and all(before), f"{', '.join(names)}: {before} became {after}", "the same, none of them 0")
    return f"{', '.join(names)}: {before}, after NMT 81h {after}"


@dialogue("BUS-ERR-02")
def errors_on_the_wire_read_0(t: Talk, row: Requirement) -> str:
    """Upload the error counters of the CAN controller."""
    due = int(row.limit("count"))
    found = {name: t.counter(name) for name in ERRORS_OF_CAN}
    expect(not any(v != due for v in found.values()), f"{found}", f"{due}")
    return f"{', '.join(found)} are {due}"


@dialogue("BUS-ERR-01", needs={"can", "errors"})
def errors_on_the_wire_are_counted(t: Talk, row: Requirement) -> str:
    """Upload the error counters of the CAN controller while frames are destroyed."""
    most = int(row.limit("count_max"))
    found = {name: t.counter(name) for name in ERRORS_OF_CAN[:2]}
    return expect(any(found.values()) and max(found.values()) <= most, f"{found}", f"1 to {most} in one of them")


@active("BUS-LOAD-01", needs={"can", "stamps", "lockstep", "stream"})
def the_load_is_the_share_of_the_bus(s: Dut, row: Requirement) -> str:
    """Stream for a second between two reads of the load, and count the bits of all frames meanwhile."""
    with s.take(lines=False) as take, talk(s, reset=True, take=take) as t:
        s.wait_ready()
        t.stream(1)
        t.counter(LOAD)
        at, begun_s = len(take.frames), s.bench.time_s
        s.run_for(LOAD_S)
        found = t.counter(LOAD) * row.limit("unit_pct")
        took_s = s.bench.time_s - begun_s
        frames = [f for f in take.frames[at:] if not f.error]
    busy_s = sum(frame_bits(f.can_id, f.data) + SPACE_BITS for f in frames if not f.fd) / row.limit("bit_hz")
    due = 100.0 * busy_s / took_s
    if abs(found - due) > row.limit("tolerance_pct"):
        raise Failed(f"{found:.1f} %", f"{due:.2f} % by {len(frames)} frames in {took_s:.6f} s")
    return f"{found:.1f} %, {due:.2f} % by the bits of {len(frames)} frames"


@dialogue("BUS-ID-08", needs={"can", "stamps", "exact"}, reset=True)
def an_answer_waits_for_the_interframe_space(t: Talk, row: Requirement) -> str:
    """Take the time from a request on a quiet bus to the end of its answer, and take off the bits of both."""
    bit_s, least = 1.0 / row.limit("bit_hz"), row.limit("interframe_bits")
    found: list[float] = []
    t.beat(0)
    for request in (read(Common.DEVICE_TYPE), read(Common.HEARTBEAT_MS), read(NOWHERE)):
        t.s.run_for(0.02)
        t.drain()
        sent_s = t.s.bench.time_s
        answer = t.answer_to(request)
        bits = frame_bits(t.sdo_rx, request) + frame_bits(answer.can_id, answer.data)
        found.append((answer.t_s - sent_s) / bit_s - bits)
    if min(found) < least - STAMP_S / bit_s:
        raise Failed(f"{min(found):.1f} bits between a request and its answer", f"{least} and more")
    return f"{', '.join(f'{x:.1f}' for x in found)} bits between requests and answers"


STAMP_S = 1e-6  # of socketcand's time stamps
