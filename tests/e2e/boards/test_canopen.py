"""python-canopen with its own threads, as anybody would use it, against a unit in real time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import canopen
import pytest
from canopen.sdo.exceptions import SdoAbortedError
from rig import EDS, TIMEOUT_S, MakeRig, Rig, over, until

NODE = 5
BOOT_UP = 0  # heartbeat state
OPERATIONAL, STOPPED, PRE_OPERATIONAL = "OPERATIONAL", "STOPPED", "PRE-OPERATIONAL"

every_link = over("socketcand", "vcan", "slc0")


@pytest.fixture
def rig(transport: str, make_rig: MakeRig) -> Rig:
    rig = make_rig(transport, pace="wall")
    rig.unit.wait_ready()
    return rig


@pytest.fixture
def network(rig: Rig) -> Iterator[canopen.Network]:
    """A network of python-canopen, on the bus beside our own host."""
    network = canopen.Network()
    interface, channel = rig.spec.split(",")[0].split(":", 1)
    if interface == "socketcand":
        host, port = channel.rsplit(":", 1)
        network.connect(interface=interface, channel="can0", host=host, port=int(port), tcp_tune=True)
    else:
        network.connect(interface=interface, channel=channel)
    yield network
    network.disconnect()


@pytest.fixture
def node(network: canopen.Network) -> Any:
    remote = network.add_node(NODE, str(EDS))
    remote.sdo.RESPONSE_TIMEOUT = TIMEOUT_S
    return remote


@every_link
def test_the_scanner_finds_the_node(network: canopen.Network) -> None:
    network.scanner.search(limit=16)
    until(lambda: network.scanner.nodes == [NODE], "node 5, and no other")


@every_link
def test_objects_are_read_by_the_names_of_the_eds(node: Any) -> None:
    assert node.sdo["Manufacturer device name"].raw == "PSA-2"  # segmented upload
    assert node.sdo["Identity object"]["Product code"].raw == 0x50534132
    assert node.sdo["Accelerometer converter X"]["CONFIG0"].raw == 0x56


@every_link
@pytest.mark.parametrize(
    "text", ["x", "four", "seven c", "a remark of sixty-four characters, as long as one can possibly become"[:64]]
)
def test_a_string_of_any_length_goes_down_and_up_again(node: Any, text: str) -> None:
    node.sdo["Remark"].raw = text
    assert node.sdo["Remark"].raw == text


@every_link
def test_a_refusal_is_an_abort_with_its_code(node: Any) -> None:
    with pytest.raises(SdoAbortedError) as refused:
        node.sdo["Accelerometer converter X"]["ID"].raw = 1
    assert refused.value.code == 0x06010002


@every_link
def test_nmt_moves_the_node_and_its_heartbeat_says_so(node: Any) -> None:
    node.sdo["Producer heartbeat time"].raw = 100  # ms
    for state in (OPERATIONAL, STOPPED, PRE_OPERATIONAL):
        node.nmt.state = state
        heartbeats = (node.nmt.wait_for_heartbeat(TIMEOUT_S) for _ in range(3))  # one may have been on its way
        assert state in heartbeats
    heard: list[int] = []
    node.nmt.add_heartbeat_callback(heard.append)  # wait_for_bootup() misses a message that comes before it is called
    node.nmt.state = "RESET"
    until(lambda: BOOT_UP in heard, "the boot-up message")
    assert node.nmt.wait_for_heartbeat(TIMEOUT_S) == PRE_OPERATIONAL


@every_link
def test_a_pdo_calls_back_with_codes_in_sequence(node: Any) -> None:
    seen: list[tuple[int, int]] = []
    node.tpdo.read()  # mapping as the node has it
    node.tpdo[1].add_callback(lambda pdo: seen.append((pdo[0].raw, pdo[2].raw)))
    node.nmt.state = OPERATIONAL
    until(lambda: len(seen) >= 200, "two hundred samples")
    node.nmt.state = PRE_OPERATIONAL
    first = seen[0][1]
    assert [seq for _, seq in seen] == [(first + k) % 2**16 for k in range(len(seen))]
    assert {round(x * 10.0 / 2**23, 3) for x, _ in seen[-100:]} == {2.489}


@every_link
def test_an_emergency_is_received_and_ends(node: Any) -> None:
    emergencies: list[int] = []
    node.emcy.add_callback(lambda e: emergencies.append(e.code))
    with pytest.raises(SdoAbortedError) as refused:
        node.sdo["Accelerometer converter X"]["CONFIG0"].raw = 0x66  # 4000 samples a second as pairs: 108 % of the bus
    assert refused.value.code == 0x08000022
    until(lambda: emergencies == [0xFF03], "the emergency that the stream was refused")
    assert "108" in node.sdo["Last refusal"].raw
    node.sdo["Frame form"].raw = 1  # fits
    until(lambda: emergencies == [0xFF03, 0x0000], "the end of the emergency")
