"""A kernel's vcan0 itself, without the emulator: what every other test over it takes for granted."""

import itertools
import subprocess
from collections.abc import Iterator

import can
import pytest
from rig import TIMEOUT_S, need

pytestmark = pytest.mark.vcan


def same(got: can.Message, sent: can.Message) -> bool:
    return got.equals(sent, timestamp_delta=None, check_channel=False, check_direction=False)


def read_up_to(bus: can.BusABC, last: can.Message) -> None:
    """Take what was on its way before it: the kernel may still deliver frames of an emulator that has ended."""
    while (got := bus.recv(timeout=TIMEOUT_S)) is not None:
        if same(got, last):
            return
    pytest.fail(f"{last}: nothing received")


@pytest.fixture
def pair() -> Iterator[tuple[can.BusABC, can.BusABC]]:
    need("vcan")
    last = can.Message(arbitration_id=0x7FF, data=b"last", is_extended_id=False)
    with (
        can.Bus(interface="socketcan", channel="vcan0", fd=True) as a,
        can.Bus(interface="socketcan", channel="vcan0", fd=True) as b,
    ):
        with can.Bus(interface="socketcan", channel="vcan0") as third:
            third.send(last)
        read_up_to(a, last)
        read_up_to(b, last)
        yield a, b


@pytest.mark.parametrize(
    ("what", "sent"),
    [
        ("classic", can.Message(arbitration_id=0x181, data=bytes(range(8)), is_extended_id=False)),
        ("empty", can.Message(arbitration_id=0x080, data=b"", is_extended_id=False)),
        ("29 bits", can.Message(arbitration_id=0x1ABCDEF0, data=b"\x55", is_extended_id=True)),
        (
            "FD, 64 bytes, fast",
            can.Message(
                arbitration_id=0x281,
                data=bytes(range(64)),
                is_extended_id=False,
                is_fd=True,
                bitrate_switch=True,
            ),
        ),
    ],
)
def test_a_frame_arrives_as_it_was_sent(pair: tuple[can.BusABC, can.BusABC], what: str, sent: can.Message) -> None:
    a, b = pair
    a.send(sent)
    got = b.recv(timeout=TIMEOUT_S)
    assert got is not None, f"{what}: nothing received"
    assert same(got, sent)


def test_candump_sees_every_frame_of_cangen(pair: tuple[can.BusABC, can.BusABC]) -> None:
    frames = 200
    # candump says nothing when it is ready, so a frame is repeated until it has seen one.
    with subprocess.Popen(["candump", "-L", "-r", "4000000", "vcan0"], stdout=subprocess.PIPE, text=True) as dump:
        assert dump.stdout is not None
        try:
            ready = can.Message(arbitration_id=0x7FF, is_extended_id=False)
            task = pair[0].send_periodic(ready, 0.02)
            assert "7FF#" in dump.stdout.readline()
            task.stop()
            subprocess.run(
                ["cangen", "vcan0", "-g", "0", "-n", str(frames), "-I", "123", "-D", "i", "-L", "8"],
                check=True,
            )
            rows = (line.split()[2] for line in dump.stdout)
            got = list(itertools.islice((row for row in rows if row.startswith("123#")), frames))
        finally:
            dump.terminate()
    # cangen -D i counts up in the first byte, least significant first.
    assert [int.from_bytes(bytes.fromhex(row.split("#")[1]), "little") for row in got] == list(range(frames))
