"""The UDS door as a stranger's client sees it: udsoncan over can-isotp, in step pace, beside our host's SDO."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import isotp
import pytest
import udsoncan
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from rig import BENCH, MakeRig, Rig, bus_spec, over, psa_emu
from uds_client import FUNCTIONAL, REQUEST, RESPONSE, StepConnection, uds_client
from udsoncan.exceptions import NegativeResponseException

pytestmark = pytest.mark.host

SERIAL, NAME, SESSION, COUNTERS = 0xF18C, 0xF197, 0xF186, 0xFD00
CONFIG0, REMARK = 0x2002, 0x3000  # objects 2000h:2 and 2040h: docs/tools/uds.md
TEXT = "a remark of sixty-four characters, as long as one can possibly become"[:64]
CODECS: dict[int | str, str | udsoncan.DidCodec | type[udsoncan.DidCodec]] = {
    SERIAL: "<I",
    NAME: udsoncan.AsciiCodec(5),
    SESSION: "<B",
    COUNTERS: "<6I",
    CONFIG0: "<B",
    REMARK: udsoncan.AsciiCodec(64),
}
SET_UP_S = 1.0  # of the board, then registers can be read
DEFAULT, EXTENDED = 1, 3
both_links = over("socketcand", "slcan")


def with_uds(folder: Path) -> Path:
    """The bench of all tests, with a door."""
    scenario = folder / "uds.yaml"
    scenario.write_text(BENCH.read_text().replace("    node: 5\n", "    node: 5\n    uds_ecu: 1\n"))
    return scenario


@pytest.fixture
def transport() -> str:
    return "socketcand"


@pytest.fixture
def rig(transport: str, make_rig: MakeRig, tmp_path: Path) -> Rig:
    rig = make_rig(transport, with_uds(tmp_path))
    rig.host.advance(SET_UP_S)
    return rig


def connection(client: Any) -> StepConnection:
    assert isinstance(client.conn, StepConnection)
    return client.conn


def code_of(refused: pytest.ExceptionInfo[NegativeResponseException]) -> int:
    return refused.value.response.code or 0


def ask(client: Any, request: str) -> str:
    """One message and its answer, both in hexadecimal digits; "" after a second without one."""
    conn = connection(client)
    conn.specific_send(bytes.fromhex(request))
    answer = conn.wait_frame(timeout=1.0)
    return answer.hex(" ").upper() if answer else ""


@both_links
def test_what_is_written_over_one_door_is_read_over_the_other(rig: Rig) -> None:
    with uds_client(rig.host, CODECS, blocksize=3) as client:
        values = client.read_data_by_identifier([SERIAL, NAME, CONFIG0]).service_data.values
        assert values == {SERIAL: (1,), NAME: "PSA-2", CONFIG0: (0x56,)}
        client.change_session(EXTENDED)
        client.write_data_by_identifier(REMARK, TEXT)  # in several frames
        assert rig.unit.node.read(0x2040) == TEXT
        client.write_data_by_identifier(CONFIG0, 0x5E)
        assert rig.unit.node.read(0x2000, 2) == 0x5E
        rig.unit.node.write(0x2000, 2, 0x56)
        assert client.read_data_by_identifier([CONFIG0]).service_data.values[CONFIG0] == (0x56,)
        assert connection(client).errors == []


def test_a_long_read_comes_whole_at_the_pace_that_the_client_sets(rig: Rig) -> None:
    rig.unit.node.write(0x2040, 0, TEXT)
    seen: list[float] = []
    rig.host.listeners.append(lambda m: seen.append(m.timestamp) if m.arbitration_id == RESPONSE else None)
    with uds_client(rig.host, CODECS, stmin=4) as client:
        conn = connection(client)
        conn.specific_send(bytes.fromhex("22" + "3000" * 8))
        answer = conn.wait_frame(timeout=2.0)
    assert answer == b"\x62" + (b"\x30\x00" + TEXT.encode()) * 8  # 529 bytes
    consecutive = [t for t, frame in zip(seen, conn.frames, strict=True) if frame[0] >> 4 == 2]
    assert len(consecutive) == 75
    assert min(b - a for a, b in itertools.pairwise(consecutive)) >= 0.004


def test_a_session_ends_after_five_seconds_without_a_request(rig: Rig) -> None:
    with uds_client(rig.host, CODECS) as client:
        with pytest.raises(NegativeResponseException) as refused:
            client.write_data_by_identifier(REMARK, TEXT)
        assert code_of(refused) == 0x7F
        timing = client.change_session(EXTENDED).service_data
        assert (timing.p2_server_max, timing.p2_star_server_max) == (0.05, 5.0)
        conn = connection(client)
        for _ in range(2):
            conn.pump(4.9)
            with client.suppress_positive_response(wait_nrc=False):
                client.tester_present()
        conn.pump(4.9)
        assert client.read_data_by_identifier([SESSION]).service_data.values[SESSION] == (EXTENDED,)
        conn.pump(5.01)
        values = client.read_data_by_identifier([SESSION, COUNTERS]).service_data.values
        assert values[SESSION] == (DEFAULT,)
        assert values[COUNTERS][3] == 1  # S3 timeouts


REFUSALS = [
    ("27 01", "7F 27 11"),
    ("10 02", "7F 10 12"),
    ("11 03", "7F 11 12"),
    ("19 0A FF", "7F 19 12"),
    ("22 F1", "7F 22 13"),
    ("2E 20 02 56 00", "7F 2E 13"),
    ("22 F1 90", "7F 22 31"),
    ("2E 20 01 00", "7F 2E 31"),  # CONFIG0's neighbour ID is read-only
    ("2E 20 02 FF", "7F 2E 31"),  # refused by the converter's model: SDO 06090030h
    ("2E 20 02 66", "7F 2E 22"),  # a stream that would not fit: SDO 08000022h
]


def test_refusals_have_the_codes_of_the_standard(rig: Rig) -> None:
    with uds_client(rig.host, CODECS) as client:
        client.change_session(EXTENDED)
        assert [(q, ask(client, q)) for q, _ in REFUSALS] == REFUSALS


def test_trouble_codes_are_the_emergencies(rig: Rig) -> None:
    with uds_client(rig.host, CODECS) as client:
        client.change_session(EXTENDED)
        assert ask(client, "2E 20 02 66") == "7F 2E 22"  # EMCY FF03h
        (dtc,) = client.get_dtc_by_status_mask(0xFF).service_data.dtcs
        assert (dtc.id, dtc.status.get_byte_as_int()) == (0xFF0300, 0x09)
        client.clear_dtc(0xFFFFFF)
        assert rig.unit.node.read(0x1003, 0) == 0
        (dtc,) = client.get_dtc_by_status_mask(0xFF).service_data.dtcs
        assert dtc.status.get_byte_as_int() == 0x01  # the condition is still there


def test_an_ecu_reset_is_a_reset_of_the_node(rig: Rig) -> None:
    heard: list[int] = []
    with uds_client(rig.host, CODECS) as client:
        client.change_session(EXTENDED)
        client.write_data_by_identifier(CONFIG0, 0x5E)
        rig.host.listeners.append(lambda m: heard.append(m.arbitration_id))
        client.ecu_reset(1)
        assert heard[:2] == [RESPONSE, 0x705]
        assert ask(client, "22 20 02") == "7F 22 22"  # set-up begins again
        connection(client).pump(SET_UP_S)
        values = client.read_data_by_identifier([CONFIG0, SESSION]).service_data.values
        assert values == {CONFIG0: (0x56,), SESSION: (DEFAULT,)}


def test_a_request_to_all_is_answered_unless_it_is_not_for_this_unit(rig: Rig) -> None:
    conn = StepConnection(rig.host)
    for request in ("023E00", "022701"):
        rig.host.send(FUNCTIONAL, bytes.fromhex(request))
        conn.pump(0.05)
    assert conn.frames == [bytes.fromhex("027E00CCCCCCCCCC")]


def test_flow_control_that_breaks_ends_the_response_and_nothing_else(rig: Rig) -> None:
    """None at all, overflow, an unknown status, and one that comes too late."""
    rig.unit.node.write(0x2040, 0, TEXT)
    conn = StepConnection(rig.host)
    for flow, wait_s in ((None, 0.0), ("320000", 0.0), ("350000", 0.0), ("300000", 1.01)):
        conn.frames.clear()
        rig.host.send(REQUEST, bytes.fromhex("03223000"))
        rig.host.advance(0.01 + wait_s)
        if flow:
            rig.host.send(REQUEST, bytes.fromhex(flow))
        rig.host.advance(0.01)
        if not flow:
            rig.host.send(REQUEST, bytes.fromhex("023E00"))  # half duplex: ignored
            rig.host.advance(1.0)
        assert [f[0] >> 4 for f in conn.frames] == [1], flow
        rig.host.send(REQUEST, bytes.fromhex("023E00"))
        rig.host.advance(0.01)
        assert conn.frames[1:] == [bytes.fromhex("027E00CCCCCCCCCC")], flow


def test_a_request_that_does_not_fit_or_is_out_of_order_is_dropped(rig: Rig) -> None:
    with uds_client(rig.host, CODECS) as client:
        conn = connection(client)
        conn.specific_send(bytes([0x2E, 0x30, 0x00]) + bytes(510))  # one byte more than the buffer
        conn.pump(0.05)
        assert [type(e) for e in conn.errors] == [isotp.errors.OverflowError]
        rig.host.send(REQUEST, bytes.fromhex("10142E3000616263"))
        rig.host.advance(0.01)
        rig.host.send(REQUEST, bytes.fromhex("2264656667686970"))
        rig.host.send(REQUEST, bytes.fromhex("2371727374757677"))
        conn.pump(0.05)
        assert client.read_data_by_identifier([COUNTERS]).service_data.values[COUNTERS][4:] == (2, 1)


BOARDS = {1: "psa2", 2: "psd1", 3: "pmka", 4: "pik"}


def test_each_board_has_its_door_and_its_number(tmp_path: Path, make_rig: MakeRig) -> None:
    scenario = tmp_path / "four.yaml"
    units = ", ".join(f"{{name: u{ecu}, board: {board}, uds_ecu: {ecu}}}" for ecu, board in BOARDS.items())
    scenario.write_text(f"units: [{units}]\n")
    rig = make_rig("socketcand", scenario)
    rig.host.advance(SET_UP_S)
    heard: dict[int, bytes] = {}
    rig.host.listeners.append(lambda m: heard.update({m.arbitration_id: bytes(m.data)}))
    for ecu, board in BOARDS.items():
        rig.host.send(REQUEST + ecu - 1, bytes.fromhex("0322F197"))
        rig.host.advance(0.01)
        assert board[:3].upper().encode() in heard.pop(RESPONSE + ecu - 1)  # of PSA-2 the first frame
        rig.host.send(REQUEST + ecu - 1, bytes.fromhex("300000"))
    rig.host.advance(0.01)
    rig.host.send(FUNCTIONAL, bytes.fromhex("0322F18C"))
    rig.host.advance(0.01)
    assert {ecu: heard[RESPONSE + ecu - 1][4] for ecu in BOARDS} == {1: 1, 2: 2, 3: 3, 4: 4}  # serial numbers


def frames_of(scenario: Path, log: Path) -> bytes:
    done = psa_emu(scenario, "--start", "--pace", "free", "--for", "200ms", "--can", f"log:{log}", "--quiet")
    assert done.returncode == 0, done.stderr
    return log.read_bytes()


def test_without_the_key_nobody_answers_and_with_it_the_bus_is_the_same(tmp_path: Path, make_rig: MakeRig) -> None:
    assert frames_of(BENCH, tmp_path / "without.log") == frames_of(with_uds(tmp_path), tmp_path / "with.log")
    rig = make_rig("socketcand")
    conn = StepConnection(rig.host)
    for can_id in (REQUEST, FUNCTIONAL):
        rig.host.send(can_id, bytes.fromhex("023E00"))
    rig.host.advance(2.0)
    assert conn.frames == []


def script(scenario: Path, save: Path | None = None) -> list[tuple[float, bytes]]:
    """A session with all kinds of messages: what came, and when."""
    seen: list[tuple[float, bytes]] = []
    with (
        Emulator(scenario, cans=["socketcand:0"], pace="step") as emulator,
        CanHost(open_bus(bus_spec(emulator.endpoints[0])), WallClock()) as host,
        Control(emulator.control_path or Path()) as control,
    ):
        host.clock = StepClock(control)
        host.listeners.append(lambda m: seen.append((m.timestamp, bytes(m.data))))
        host.advance(SET_UP_S)
        with uds_client(host, CODECS, blocksize=2) as client:
            client.change_session(EXTENDED)
            client.write_data_by_identifier(REMARK, TEXT)
            client.read_data_by_identifier([REMARK, CONFIG0])
        if save:
            control.call("snapshot", path=str(save))
    return seen


def test_the_same_session_gives_the_same_frames_at_the_same_times(tmp_path: Path) -> None:
    scenario = with_uds(tmp_path)
    first = script(scenario)
    assert first == script(scenario)
    assert len(first) == 17


def test_a_snapshot_keeps_the_session(tmp_path: Path) -> None:
    script(with_uds(tmp_path), tmp_path / "saved")
    extra: Sequence[str | Path] = ("--restore", tmp_path / "saved")
    with (
        Emulator(cans=["socketcand:0"], pace="step", extra=extra) as emulator,
        CanHost(open_bus(bus_spec(emulator.endpoints[0])), WallClock()) as host,
        Control(emulator.control_path or Path()) as control,
    ):
        host.clock = StepClock(control)
        with uds_client(host, CODECS) as client:
            values = client.read_data_by_identifier([SESSION, REMARK]).service_data.values
    assert values == {SESSION: (EXTENDED,), REMARK: TEXT}


@pytest.mark.parametrize(
    ("units", "why"),
    [
        ("[{uds_ecu: 5}]", "units.a.uds_ecu: expected 0 to 4, got 5"),
        ("[{uds_ecu: 1}, {uds_ecu: 1}]", "units.b.uds_ecu: expected a number of its own, got 1, which unit a has"),
    ],
)
def test_a_wrong_number_is_rejected(tmp_path: Path, units: str, why: str) -> None:
    (tmp_path / "bad.yaml").write_text(f"units: {units}\n")
    done = psa_emu(tmp_path / "bad.yaml", "--dump")
    assert done.returncode == 2
    assert why in done.stderr
