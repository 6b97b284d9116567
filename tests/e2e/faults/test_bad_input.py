"""Malformed files, options that cannot be used, a full disk: one clear line and the documented exit status.

`make test` runs this file a second time against the emulator under AddressSanitizer and UBSan.
"""

from __future__ import annotations

import socket
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest
from psabench.emulator import Emulator
from psabench.errors import LinkError
from psabench.link.can_host import CanHost, WallClock, open_bus
from psabench.link.control import Control
from rig import BENCH, HOST, ROOT, TIMEOUT_S, MakeRig, bus_spec, one_line, psa_emu, psabench, until

UNIT = "units: [{name: a, node: 5, axes: {x: {sensor: mems}}}]\n"


@HOST
@pytest.mark.parametrize(
    ("what", "text", "says"),
    [
        ("not YAML", "units: [", "{file}:2:1: not YAML"),
        ("empty", "", "{file}:1:1: expected a mapping `key: value`, got an empty file"),
        ("bytes", "\x00\x01\x7f", "{file}:1:1: expected YAML, got a NUL byte"),
        ("a list", "- 1\n- 2\n", "{file}:1:1: expected a mapping"),
        ("no units", "seed: 1\n", "units: expected at least one unit"),
        (
            "unknown key",
            UNIT + "sead: 1\n",
            "{file}:2:1: sead: unknown key, nearest: seed; expected one of version, seed",
        ),
        ("twice", "seed: 1\nseed: 2\n" + UNIT, "{file}:2:1: seed: expected the key once"),
        (
            "word for a number",
            "bus: {bitrate_hz: fast}\n" + UNIT,
            'bus.bitrate_hz: expected an integer of 0 or more, got "fast"',
        ),
        ("not a number", "site: {g_mps2: .nan}\n" + UNIT, "{file}:1:16: site.g_mps2:"),
        ("infinite", "head: {turn_s: 1e999}\n" + UNIT, "{file}:1:16: head.turn_s:"),
        ("node 200", UNIT.replace("node: 5", "node: 200"), ".node: expected 1 to 127, got 200"),
        (
            "unknown profile",
            UNIT.replace("node", "profile: mine, node"),
            ".profile: mine: expected a path or a name from proto/profiles",
        ),
        ("unknown sensor", UNIT.replace("mems", "gyro"), ".axes.x.sensor: expected none"),
        (
            "same node",
            "units:\n- {name: a, node: 5}\n- {name: b, node: 5}\n",
            "node: expected a node of its own, got 5, which unit a has",
        ),
        (
            "1001 units",
            "buses: ["
            + ", ".join(f"{{name: can{k}}}" for k in range(8))
            + "]\nunits: ["
            + ", ".join(f"{{name: u{k}, bus: can{k // 127}, node: {k % 127 + 1}}}" for k in range(1001))
            + "]",
            "expected up to 1000 units",
        ),
        (
            "bit rate",
            "bus: {bitrate_hz: 9999}\n" + UNIT,
            "expected 10000 or more, or 0 (frames take no time), got 9999",
        ),
        ("deep", "units: " + "[" * 2000, "{file}:"),
        ("long", "# " + "x" * (16 << 20) + "\n" + UNIT, "expected up to 16777216 bytes, got more"),
    ],
)
def test_a_malformed_scenario_is_refused_with_file_and_line(tmp_path: Path, what: str, text: str, says: str) -> None:
    scenario = tmp_path / "s.yaml"
    scenario.write_text(text)
    done = psa_emu(scenario, "--can", "none", "--pace", "free", "--for", "1ms")
    assert done.returncode == 2, what
    assert says.format(file=scenario) in one_line(done.stderr, "psa-emu")
    assert done.stdout == ""


@HOST
@pytest.mark.parametrize(
    ("what", "was", "now", "says"),
    [
        (
            "too fast a line",
            "line_hz: 2000000 ",
            "line_hz: 3000000 ",
            "INT low: expected 74 us or more (lead_in_clk >= ",
        ),
        ("word width", "word_bits: 32 ", "word_bits: 20 ", "word_bits"),
        ("unknown word", "[X, Y, Z, T]", "[X, Y, Z, Q]", "Q"),
        ("set-up by an unknown line", "DRD_A write_A", "DRD_B write_A", "DRD_B"),
        ("set-up with no bytes", "write_A 41 00 56", "write_A", "write_A"),
        ("misspelt key", "gate_sclk", "gate_sclck", "gate_sclck"),
        ("SCLK above the converters' limit", "sclk_hz: 1024000 ", "sclk_hz: 4096000 ", "sclk_hz"),
    ],
)
def test_a_malformed_profile_is_refused_with_the_arithmetic(
    tmp_path: Path, what: str, was: str, now: str, says: str
) -> None:
    article = (ROOT / "proto/profiles/article.yaml").read_text()
    assert was in article
    profile = tmp_path / "mine.yaml"
    profile.write_text(article.replace(was, now, 1))
    scenario = tmp_path / "s.yaml"
    scenario.write_text(UNIT.replace("node", "profile: mine.yaml, node"))
    done = psa_emu(scenario, "--can", "none", "--pace", "free", "--for", "1ms")
    assert done.returncode == 2, what
    line = one_line(done.stderr, "psa-emu")
    assert says in line
    assert "mine.yaml" in line


@HOST
@pytest.mark.parametrize(
    ("args", "status", "says"),
    [
        (
            "--can serial",
            2,
            "udp[:GROUP[:PORT]], cannelloni[:PORT[:PEER_PORT]], log:FILE or none, got",
        ),
        ("--can socketcand:70000", 2, "a port from 0 (any free port) to 65535"),
        ("--can socketcan", 2, "socketcan:IFACE"),
        ("--can slcan:{file}", 2, "expected a new name or a symbolic link to a pty"),
        ("--can slcan:{dir}/no/such", 2, "expected a path that can be written, got no such folder"),
        ("--can socketcan:none0", 3, "--can socketcan:none0: "),
        ("--can x=slcan", 2, '--can BUS=...: expected one of can0, got "x"'),
        ("--scpi oven", 2, '--scpi: expected head, table, chamber, supply or all, got "oven"'),
        ("quiet --scpi table", 2, "--scpi table: expected a scenario with a table"),
        ("--pace fast", 2, '--pace: expected wall, step or free, got "fast"'),
        ("--pace step", 2, "expected --control PATH"),
        ("--for soon", 2, "expected a time such as"),
        ("--for -1s", 2, "expected a time such as"),
        ("--for 1e9s", 2, "up to 1e6 s"),
        ("--seed 1.5", 2, "an integer from 0"),
        ("--bitrate 99", 2, "10000 to 8000000"),
        ("--vcd-unit 7", 2, "1, 10, 100"),
        ("--vcd {dir}/no/such.vcd", 2, "expected a path that can be written, got no such folder"),
        ("--vcd {dir}", 2, "expected a path that can be written, got a folder"),
        ("--line {file}", 2, "expected a new name or a symbolic link to a pty"),
        ("--unit q", 2, '--unit: expected a unit of the scenario, got "q"'),
        ("--control {file}", 2, "expected a new path or a socket, got another file"),
        ("--control {long}", 2, "up to 99 bytes"),
        ("--truth {dir}/no/such", 2, "expected a path that can be written, got no such folder"),
        ("--frobnicate", 2, "expected an option that --help lists, got --frobnicate"),
        ("--vcd", 2, "--vcd: expected an argument, got none"),
        ("no-such-scenario", 2, "no-such-scenario"),
        ("quiet stream", 2, "SCENARIO: expected one, got quiet and stream"),
        ("{dir}", 2, "{dir}: expected a YAML file, got a folder"),
    ],
)
def test_an_option_that_cannot_be_used_is_refused_in_one_line(
    tmp_path: Path, args: str, status: int, says: str
) -> None:
    (tmp_path / "file").write_text("precious")
    names = {"file": tmp_path / "file", "dir": tmp_path, "long": tmp_path / ("x" * 120)}
    base = [] if "--can" in args else ["--can", "none"]
    base += [] if "--for" in args else ["--for", "1ms"]
    base += [] if "--pace" in args else ["--pace", "free"]
    done = psa_emu(*base, *args.format(**names).split())
    assert done.returncode == status
    assert says.format(**names) in one_line(done.stderr, "psa-emu")
    assert "ready all" not in done.stdout
    assert (tmp_path / "file").read_text() == "precious"


@HOST
def test_an_occupied_port_and_an_occupied_control_socket_are_refused(tmp_path: Path) -> None:
    with Emulator(BENCH) as emulator:
        port = emulator.endpoints[0]["port"]
        done = psa_emu(BENCH, "--can", f"socketcand:{port}")
        assert done.returncode == 3
        assert f"socketcand:{port}: expected a free port of 127.0.0.1" in one_line(done.stderr, "psa-emu")
        assert emulator.control_path is not None
        done = psa_emu(BENCH, "--can", "none", "--control", emulator.control_path)
        assert done.returncode == 3
        assert "expected a free path, got one that another process uses" in one_line(done.stderr, "psa-emu")
        with Control(emulator.control_path) as control:  # the first one lost nothing by it
            assert control.call("time").result["pace"] == "step"


@pytest.mark.vcan
def test_an_interface_that_is_not_there_is_refused_with_the_command_that_makes_it() -> None:
    done = psa_emu(BENCH, "--can", "socketcan:none0")
    assert done.returncode == 3
    assert "expected a CAN interface, got none; as root: ip link add none0 type vcan" in one_line(
        done.stderr, "psa-emu"
    )


@pytest.mark.vcan
def test_an_interface_that_goes_down_loses_frames_and_comes_back(make_rig: MakeRig) -> None:
    rig = make_rig("vcan", "stream", pace="wall")
    try:
        subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
        until(lambda: rig.clients()[0]["dropped"] > 100, "frames counted as dropped")
    finally:
        subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    with suppress(LinkError):  # our own socket hears once that the interface was down
        rig.host.receive(1.0)
    until(lambda: rig.unit.stream(50) is not None, "the stream again")
    assert "Network is down" in rig.emulator.messages()


@HOST
@pytest.mark.parametrize("for_time", ["5ms", "300ms"])
def test_a_full_disk_ends_the_trace_and_not_the_run(for_time: str) -> None:
    """5 ms fit into the buffer: the loss shows only when the file is closed."""
    done = psa_emu(BENCH, "--can", "none", "--pace", "free", "--for", for_time, "--vcd", "/dev/full", "--quiet")
    assert done.returncode == 3
    assert "VCD file /dev/full: No space left on device" in one_line(done.stderr, "psa-emu")


# ---- the host's own command line


@HOST
@pytest.mark.parametrize(
    ("args", "status", "says"),
    [
        (
            "run frobnicate",
            2,
            "run: expected turns, fourier, reversal, all, compare-converters, sins-calibration, mems-gyro, "
            "sins-covariance, sins-snake, sins-calibration-secondary, koi-flight, koi-season, thermal, gyrocompass, "
            "heading-hold",
        ),
        ("run fourier --can socketcand:127.0.0.1:{port}", 2, "--head: expected the VISA address"),
        ("run fourier --positions 1 --condition quiet --out {dir}", 2, "fourier: "),
        ("run fourier --scenario {dir}/no.yaml --out {dir}", 2, "no.yaml: expected a scenario file, got no such file"),
        (
            "run fourier --can socketcand:127.0.0.1:{port} --head {head} --control {dir}/no --out {dir}",
            3,
            "is psa-emu running",
        ),
        ("run fourier --can socketcand:127.0.0.1:{port} --head {head} --out {dir}", 3, "is the instrument switched on"),
        ("run fourier --can socketcand:127.0.0.1:{port} --head lab7 --out {dir}", 2, "expected a VISA address"),
        (
            "record --can socketcand:127.0.0.1:{dead} {dir}/x.log",
            3,
            "got one that no process serves; is psa-emu running there?",
        ),
        ("record --can socketcand:127.0.0.1 {dir}/x.log", 2, "expected socketcand:HOST:PORT"),
        ("record --can frobnicate:x {dir}/x.log", 2, "frobnicate"),
        ("record --can socketcan:none0 {dir}/x.log", 3, "none0"),
        ("record --can slcan:{dir}/none {dir}/x.log", 3, "none"),
        (
            "record --can socketcand:127.0.0.1:{port} {dir}/x.xyz",
            2,
            "expected an ending of .asc .blf .csv .db .lcmlog .log .mcap .mf4 .pcap .trc .txt, got .xyz",
        ),
        (
            "record --can socketcand:127.0.0.1:{port} {dir}/no/x.log",
            2,
            "expected a path that can be written, got no such folder",
        ),
        ("decode {dir}/no.log", 2, "no.log: expected a CAN log, got no such file"),
        ("decode {file}", 2, "the 0 before it are good"),
    ],
)
def test_a_command_that_cannot_be_carried_out_is_refused_in_one_line(
    make_rig: MakeRig, tmp_path: Path, args: str, status: int, says: str
) -> None:
    rig = make_rig("socketcand", pace="wall")
    (tmp_path / "bad.log").write_text("this is no log\n")
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))  # not listening: connections are refused
        names = {
            "dir": tmp_path,
            "file": tmp_path / "bad.log",
            "port": rig.emulator.endpoints[0]["port"],
            "dead": unused.getsockname()[1],
            "head": f"TCPIP::127.0.0.1::{unused.getsockname()[1]}::SOCKET",
        }
        with psabench(*args.format(**names).split()) as command:
            try:
                _, err = command.communicate(timeout=TIMEOUT_S)
            finally:
                command.kill()
    assert command.returncode == status, err
    assert says in one_line(err, "psabench")


@HOST
def test_what_is_no_socketcand_server_is_told_and_not_waited_for() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with psabench("record", "--can", f"socketcand:127.0.0.1:{port}", "/dev/null.log") as command:
            try:
                connection, _ = other.accept()
                connection.sendall(b"220 mail ready\r\n")
                _, err = command.communicate(timeout=TIMEOUT_S)
                connection.close()
            finally:
                command.kill()
    assert command.returncode == 3
    assert "expected a socketcand server" in one_line(err, "psabench")


@HOST
def test_emulators_side_by_side_do_not_hear_each_other() -> None:
    with Emulator(BENCH) as a, Emulator(BENCH) as b:
        assert a.control_path is not None
        assert b.control_path is not None
        with (
            CanHost(open_bus(bus_spec(a.endpoints[0])), WallClock()) as host,
            Control(a.control_path) as to_a,
            Control(b.control_path) as to_b,
        ):
            host.send(0x123, b"1")
            to_a.call("run", for_s=0.01, after_tx=1)
            to_b.call("run", for_s=0.01)
            assert to_a.call("counters").result["bus"]["frames"] == to_b.call("counters").result["bus"]["frames"] + 1
