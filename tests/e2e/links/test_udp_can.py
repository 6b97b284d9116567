"""CAN over UDP multicast, with unmodified python-can, in a network namespace of the test's own: support/udp_case.py."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rig import HOST, ROOT, TIMEOUT_S, psa_emu

CASE = Path(__file__).resolve().parents[1] / "support" / "udp_case.py"
LO = "ip link set lo up"
IPV4 = f"{LO} && ip route add 239.0.0.0/8 dev lo"
# lo has no IPv6 multicast: two interfaces joined by a cable
IPV6 = (
    f"{LO} && ip link add v0 type veth peer name v1 && ip address add fd00::1/64 dev v0 nodad && "
    "ip address add fd01::1/64 dev v1 nodad && ip link set v0 up && ip link set v1 up && "
    'until ip -6 route show table local | grep -q "multicast.*v1"; do :; done'
)

pytestmark = [HOST, pytest.mark.timeout(2 * TIMEOUT_S)]


def in_namespace(setup: str, *command: str | Path) -> subprocess.CompletedProcess[str]:
    """Skips, with its reason, where there is no namespace to be had."""
    shell = ["unshare", "-rn", "sh", "-c", f'{{ {setup}; }} || exit 77; exec "$@"', "sh"]
    done = subprocess.run(
        [*shell, *command], capture_output=True, text=True, cwd=ROOT, timeout=2 * TIMEOUT_S, check=False
    )
    if done.returncode == 77 or done.stderr.startswith("unshare:"):
        pytest.skip(f"no network namespace with multicast here: {done.stderr.strip()}")
    return done


def run(case: str, setup: str = IPV4) -> dict[str, Any]:
    done = in_namespace(setup, sys.executable, CASE, case)
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def test_python_can_sends_every_kind_of_frame_and_no_echo_comes_back() -> None:
    r = run("frames_of_all_kinds")
    assert r["same"]
    assert [i for i in r["got"] if i < 0x700] == [0x123, 0x124, 0x125, 0x126], "each of them once"
    assert r["counters"]["taken"] == 5
    assert r["counters"]["refused"] == 0


def test_the_datagrams_are_python_can_s_own_and_stay_on_this_machine() -> None:
    assert run("datagrams") == {"equal": True, "ttl": 0, "own_port": True}


def test_what_is_no_frame_is_refused_counted_and_said_once() -> None:
    r = run("hostile")
    assert r["refused"] == r["sent"]


def test_our_host_has_every_frame_and_none_of_its_own() -> None:
    r = run("host")
    assert r["spec"] == "udp:[239.74.163.2]:43113"
    assert r["client"]["taken"] == r["sent"]
    assert r["client"]["delivered"] == r["received"]
    assert r["frames"] == 100


def test_what_the_kernel_loses_is_counted() -> None:
    r = run("flood")
    assert r["taken"] + r["overrun"] == r["sent"]


def test_a_snapshot_has_what_came_over_the_group() -> None:
    r = run("restored")
    assert r["got"] == r["want"]


def test_an_ipv6_group_works_where_an_interface_has_multicast() -> None:
    r = run("ipv6", IPV6)
    assert r["answer"] & 0xE0 == 0x40
    assert r["counters"]["refused"] == 0


def test_without_a_route_the_commands_that_help_are_named() -> None:
    done = in_namespace(LO, ROOT / "build" / "psa-emu", "stream", "--can", "udp")
    assert done.returncode == 3
    assert "expected a route for multicast" in done.stderr
    assert "ip route add 239.0.0.0/8 dev lo" in done.stderr


@pytest.mark.parametrize("group", ["224.0.0.1", "127.0.0.1", "239.1.1.1:0", "[ff15::1", "ff15::1]", "example.org"])
def test_a_group_that_cannot_be_is_refused(group: str) -> None:
    done = psa_emu("stream", "--can", f"udp:{group}")
    assert done.returncode == 2
    assert "239.x.y.z or ff..::.." in done.stderr
