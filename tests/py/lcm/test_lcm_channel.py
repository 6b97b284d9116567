"""LCM in one process (memq://): frames as a bus, progress and results; addresses that are refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import can
import lcm
import pytest
from psabench.errors import BadInput, OutputError
from psabench.estimate.uncertainty import Estimate
from psabench.lcm.channel import LcmBus, publisher
from psabench.lcm.event_log import read_events
from psabench.lcm.frames import to_values
from psabench.lcm.progress import LcmProgress, publish_result
from psabench.lcm.types import lcm_type
from psabench.procedures.head_bench import Silent

FRAME = can.Message(timestamp=1.5, arbitration_id=0x123, is_extended_id=False, data=b"abc")
NETWORK = ["unshare", "--user", "--map-root-user", "--net"]


def bus_with(*sent: bytes) -> LcmBus:
    """A bus in memory, and these messages on its way."""
    bus = LcmBus("memq://")
    for data in sent:
        bus._lcm.publish("PSABENCH_CAN_can0", data)
    return bus


def test_frames_are_received_and_none_can_be_sent() -> None:
    data = lcm_type("can_frame_t").encode(to_values(FRAME, "can0"))
    with bus_with(data, data) as bus:
        for _ in range(2):
            got = bus.recv(1.0)
            assert got is not None
            assert got.equals(FRAME, check_channel=False, check_direction=False)
        assert bus.recv(0.0) is None
        with pytest.raises(can.CanOperationError, match="use --can"):
            bus.send(FRAME)


def test_hostile_messages_are_counted_and_the_next_frame_comes() -> None:
    kind = lcm_type("can_frame_t")
    good = kind.encode(to_values(FRAME, "can0"))
    hostile = [b"x", b"", good[:-1], good + b"x", good[:8] + b"\xff" * (len(good) - 8)]
    hostile += [kind.encode(to_values(FRAME, "can0") | {"length": 64, "size": 64, "data": bytes(64), "fd": False})]
    hostile = [h for h in hostile if h]  # memq does not carry an empty one
    with bus_with(*hostile, good) as bus:
        got = bus.recv(1.0)
        assert got is not None
        assert bytes(got.data) == b"abc"
        assert bus.bad == len(hostile)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("udpm://239.255.76.67:7667?ttl=1", "ttl=0, so that messages stay on this machine"),
        ("udpm://127.0.0.1:7667", "udpm://GROUP:PORT"),
        ("udpm://239.1:7667", "udpm://GROUP:PORT"),
        ("udpm://239.255.76.67:0", "udpm://GROUP:PORT"),
        ("udpm://239.255.76.67:99999", "udpm://GROUP:PORT"),
        ("tcpq://127.0.0.1:7700", "udpm://GROUP:PORT"),
        ("run.lcmlog", "udpm://GROUP:PORT"),
    ],
)
def test_other_addresses_are_refused(url: str, words: str) -> None:
    with pytest.raises(BadInput, match=words), publisher(url):
        pass


def test_progress_and_result_are_published_and_shown() -> None:
    shown: list[int] = []

    class Shown(Silent):
        """Counts."""

    estimate = Estimate(name="k1", symbol="k_1", unit="V/g²", value=1.5, sd=0.25, ci_half=0.5)
    with publisher("memq://") as out:
        link: lcm.LCM = out._channel  # type: ignore[assignment]
        got: list[tuple[str, dict[str, object]]] = []
        for channel, kind in (("PSABENCH_PROGRESS", "progress_t"), ("PSABENCH_RESULT", "result_t")):
            link.subscribe(channel, lambda c, d, k=kind: got.append((c, lcm_type(k).decode(d))))  # type: ignore[misc]
        with LcmProgress(out, "turns", Shown()).step("turns, direct", 3) as advance:
            for k in range(3):
                shown.append(k)
                advance()
        publish_result(out, "turns", "quiet", [estimate], within=True)
        while link.handle_timeout(0):
            pass
    steps = [(v["procedure"], v["step"], v["done"], v["total"]) for c, v in got if c == "PSABENCH_PROGRESS"]
    assert steps[0] == ("turns", "turns, direct", 0, 3)
    assert steps[-1] == ("turns", "turns, direct", 3, 3)
    (result,) = [v for c, v in got if c == "PSABENCH_RESULT"]
    del result["host_ns"]
    assert result == {
        "procedure": "turns",
        "condition": "quiet",
        "count": 1,
        "name": ("k1",),
        "value": (1.5,),
        "sd": (0.25,),
        "unit": ("V/g²",),
        "within_limits": True,
    }


def test_a_log_takes_what_is_published_and_one_writer(tmp_path: Path) -> None:
    path = tmp_path / "run.lcmlog"
    with publisher(f"file://{path}") as out:
        publish_result(out, "turns", "", [], within=False)
        with pytest.raises(BadInput, match="a file that no other process writes"), publisher(f"file://{path}"):
            pass
        publish_result(out, "turns", "", [], within=True)
    assert [e.values["within_limits"] for e in read_events(path)] == [False, True]
    with (
        pytest.raises(OutputError, match="No space left on device; stored 0 messages"),
        publisher("file:///dev/full") as o,
    ):
        publish_result(o, "turns", "", [], within=True)


def test_a_missing_route_is_one_clear_line() -> None:
    code = "from psabench.cli import main; import sys; sys.exit(main(sys.argv[1:]))"
    argv = [sys.executable, "-c", code, "record", "/dev/null.log", "--lcm", "udpm://239.255.76.67:7667"]
    done = subprocess.run([*NETWORK, *argv], capture_output=True, text=True, check=False, timeout=60)
    if "unshare failed" in done.stderr:
        pytest.skip("no network namespace of one's own here")
    assert done.returncode == 3
    words = "expected a route for multicast (as root: ip route add 224.0.0.0/4 dev lo), got none"
    assert done.stderr == f"psabench: udpm://239.255.76.67:7667: {words}\n"
