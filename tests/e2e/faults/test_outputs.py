"""Every kind of file that is written, on a full disk, on a read-only one, removed under way, claimed twice.

Each cell gives one line that names the file, what is wrong, what was stored, and status 3 for the machine's faults, 2
for the user's. The disks are file systems in memory, mounted in a namespace of the program's own.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import can
import numpy as np
import pytest
from psabench.campaign.store import Origin, Part, Store
from psabench.emulator import Emulator
from psabench.errors import BenchError, ControlError
from psabench.lcm.event_log import read_events
from psabench.link.control import Control
from psabench.link.own import Owned, output_text
from psabench.link.vcd import read_vcd
from psabench.places import find_emulator
from rig import HOST, PSABENCH, ROOT, TIMEOUT_S, one_line, psa_emu, until

pytestmark = HOST

NAMESPACE = ["unshare", "--user", "--map-root-user", "--mount"]
MOUNT = 'mount -t tmpfs -o "$1" none "$2" && cd "$3" && shift 3 && exec "$@"'
LONG, SHORT = "20s", "1s"  # of simulated time: more than a small disk holds, and enough to begin


@dataclass(frozen=True)
class Output:
    """A file of the emulator's: how it is asked for, and what a whole file of the kind is."""

    options: Callable[[str], list[str]]
    whole: Callable[[Path], bool]


def whole_log(path: Path) -> bool:
    with can.LogReader(path) as log:
        return len(list(log)) == path.read_text().count("\n") > 0


def whole_truth(path: Path) -> bool:
    lines = path.read_text()
    return lines.endswith("\n") and all("t_ns" in json.loads(line) for line in lines.splitlines())


def whole_lcm(path: Path) -> bool:
    return len(list(read_events(path))) > 0


OUTPUTS = {
    "lcm": Output(lambda p: ["--can", "none", "--lcm", f"file://{p}"], whole_lcm),
    "vcd": Output(lambda p: ["--can", "none", "--vcd", p], lambda p: read_vcd(p).end_ns > 0),
    "log": Output(lambda p: ["--can", f"log:{p}"], whole_log),
    "truth-log": Output(lambda p: ["--can", "none", "--truth-log", p, "--truth-every", "1ms"], whole_truth),
}
READ_ONLY = "expected a path that can be written, got a read-only file system"
KINDS = pytest.mark.parametrize("kind", sorted(OUTPUTS))


def emulate(kind: str, path: Path, *more: str) -> list[str]:
    return [str(find_emulator()), "stream", "--quiet", *OUTPUTS[kind].options(str(path)), *more]


def wait_ready(stdout: IO[str]) -> None:
    for line in stdout:
        if line == "ready all\n":
            return
    raise AssertionError("the emulator ended")


def on_disk(options: str, disk: Path, command: Sequence[str | Path]) -> subprocess.CompletedProcess[str]:
    """Run a command with a file system of its own mounted at `disk`."""
    argv = [*NAMESPACE, "sh", "-ec", MOUNT, "sh", options, str(disk), str(ROOT), *(str(c) for c in command)]
    return subprocess.run(argv, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)


@pytest.fixture
def disk(tmp_path: Path) -> Path:
    """Where a disk may be mounted; skips where a user may mount none."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if on_disk("size=64k", folder, ["true"]).returncode != 0:
        pytest.skip("no mount in a namespace of one's own: no disk to fill")
    return folder


def then_copied(command: Sequence[str], left: Path, to: Path) -> list[str]:
    """The command, then a copy of the file that it leaves on its disk; the status is the command's."""
    return ["sh", "-c", 'left=$0 to=$1; shift; "$@"; rc=$?; cp "$left" "$to"; exit $rc', str(left), str(to), *command]


# ---- the emulator's files


@KINDS
def test_a_full_disk_ends_the_file_whole_and_not_the_run(kind: str, disk: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.log"
    run = emulate(kind, disk / "file.log", "--pace", "free", "--for", LONG)
    done = on_disk("size=256k", disk, then_copied(run, disk / "file.log", copy))
    assert done.returncode == 3
    line = one_line(done.stderr, "psa-emu")
    assert f"{disk}/file.log: No space left on device; stored " in line
    assert line.endswith("the run continues")
    assert OUTPUTS[kind].whole(copy)
    stored = int(re.findall(r"stored (\d+)", line)[0])
    counted = {
        "vcd": lambda: copy.stat().st_size,
        "lcm": lambda: len(list(read_events(copy))),
    }.get(kind, lambda: copy.read_text().count("\n"))()
    assert stored == counted > 100


@KINDS
@pytest.mark.parametrize(
    ("where", "says"),
    [
        ("disk/file", READ_ONLY),
        ("nowhere/file", "expected a path that can be written, got no such folder"),
        (".", "expected a path that can be written, got a folder"),
    ],
)
def test_a_path_that_cannot_be_written_is_the_user_s(
    kind: str, where: str, says: str, disk: Path, tmp_path: Path
) -> None:
    done = on_disk("ro", disk, emulate(kind, tmp_path / where, "--for", SHORT))
    assert done.returncode == 2
    assert one_line(done.stderr, "psa-emu").endswith(f"{tmp_path / where}: {says}")


@KINDS
@pytest.mark.parametrize("how", ["moved", "removed", "replaced"])
def test_a_file_that_goes_under_way_is_told_within_a_second_or_so(kind: str, how: str, tmp_path: Path) -> None:
    path, other = tmp_path / "file.log", tmp_path / "other.log"
    argv = emulate(kind, path, "--pace", "wall", "--for", "60s")
    with subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT) as run:
        assert run.stdout is not None
        assert run.stderr is not None
        wait_ready(run.stdout)
        if how == "moved":
            until(lambda: path.stat().st_size > 0, "something in it")
            path.rename(other)
        elif how == "removed":
            path.unlink()
        else:
            other.touch()
            other.rename(path)
        line = run.stderr.readline()
        assert run.poll() is None, "told while it runs, not at its end"
        run.terminate()
        rest = run.communicate(timeout=TIMEOUT_S)[1]
    assert f"{path}: moved, removed or replaced while it was written; stored " in line
    if how == "moved":
        assert OUTPUTS[kind].whole(other), "what there is of it can be read where it is now"
    else:
        assert "; stored 0 " in line
    assert (rest, run.returncode) == ("", 3)


@KINDS
def test_a_second_emulator_is_refused_by_the_pid_of_the_first(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "file"
    argv = emulate(kind, path, "--pace", "wall", "--until-eof")
    with subprocess.Popen(argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT) as first:
        assert first.stdout is not None
        wait_ready(first.stdout)
        size = path.stat().st_size
        done = subprocess.run(
            emulate(kind, path, "--for", SHORT),
            capture_output=True,
            text=True,
            check=False,
            timeout=TIMEOUT_S,
            cwd=ROOT,
        )
        assert done.returncode == 2
        words = f"{path}: expected a file that no other process writes, got one of pid {first.pid}"
        assert one_line(done.stderr, "psa-emu").endswith(words)
        assert path.stat().st_size >= size, "the first one's file is left alone"
        first.communicate(timeout=TIMEOUT_S)
    assert first.returncode == 0
    assert whole_lcm(path) if kind == "lcm" else b"\0" not in path.read_bytes()
    assert psa_emu("stream", "--quiet", "--for", SHORT, *OUTPUTS[kind].options(str(path))).returncode == 0


@pytest.mark.parametrize(
    "option", ["--can=slcan:{}", "--line={}", "--bus-port={}", "--serial={}", "--scpi=head:pty:{}"]
)
def test_a_link_that_an_emulator_serves_is_refused_and_a_stale_one_is_replaced(option: str, tmp_path: Path) -> None:
    link = tmp_path / "link"
    name, value = option.format(link).split("=")
    scenario = {"--bus-port": "converters", "--serial": "receiver"}.get(name, "calibrate")
    extra = [name, value] if name == "--can" else [name, value, "--can", "none"]
    argv = [str(find_emulator()), scenario, "--quiet", *extra]
    with subprocess.Popen([*argv, "--until-eof"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None
        wait_ready(first.stdout)
        target = os.readlink(link)
        with link.open("rb", buffering=0) as port:  # as pyserial's exclusive=True does
            fcntl.flock(port, fcntl.LOCK_EX | fcntl.LOCK_NB)
        done = subprocess.run([*argv, "--for", SHORT], capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
        assert done.returncode == 3
        words = f"expected a link that no other process serves, got one of pid {first.pid}"
        assert one_line(done.stderr, "psa-emu").endswith(words)
        assert os.readlink(link) == target
        first.kill()
    assert link.is_symlink(), "what a kill leaves behind"
    done = subprocess.run([*argv, "--for", SHORT], capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    assert (done.returncode, done.stderr) == (0, "")
    assert not link.is_symlink()


def test_a_control_socket_that_is_served_is_refused_by_pid(tmp_path: Path) -> None:
    with Emulator("calibrate", cans=["none"]) as emulator:
        assert emulator.control_path is not None
        done = psa_emu("calibrate", "--can", "none", "--control", emulator.control_path)
    assert done.returncode == 3
    assert done.stderr.endswith(f"got one that another process uses, pid {emulator.pid}\n")


# ---- recordings and snapshots that are asked for through the control socket


@contextmanager
def full(path: Path) -> Iterator[Path]:
    """A name under which the disk is full."""
    path.symlink_to("/dev/full")
    yield path


def test_a_recording_asked_for_on_a_full_disk_is_an_error_of_stop_and_flush(tmp_path: Path) -> None:
    with Emulator("stream", cans=["none"], pace="step") as emulator, full(tmp_path / "x.vcd") as path:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            for end in ("vcd.flush", "vcd.stop"):
                if end == "vcd.flush":
                    control.call("vcd.start", path=str(path))
                control.call("run", for_s=0.1)
                with pytest.raises(ControlError, match=r"x.vcd: No space left on device; wrote 0 bytes"):
                    control.call(end)
            control.call("vcd.start", path=str(tmp_path / "good.vcd"))
            control.call("run", for_s=0.1)
            control.call("vcd.stop")
        assert emulator.stop() == 3
        assert "x.vcd: No space left on device" in emulator.messages().splitlines()[0]
    assert read_vcd(tmp_path / "good.vcd").end_ns > 0


def test_a_recording_ends_at_its_limit_and_its_size_is_told_meanwhile(tmp_path: Path) -> None:
    path = tmp_path / "x.vcd"
    with Emulator("stream", cans=["none"], pace="step", seed=1) as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            control.call("subscribe", what="files")
            control.call("vcd.start", path=str(path), limit_mb=0.5)
            control.call("run", for_s=0.1)
            file = control.call("counters").result["files"][0]
            assert (file["kind"], file["path"], file["max_bytes"]) == ("vcd", str(path), 500_000)
            assert 0 < file["bytes"] < 500_000
            assert "error" not in file
            control.call("run", for_s=5.0)
            assert control.call("counters").result["files"][0]["error"] == "its limit of 0.5 MB is reached"
            [event] = control.events
            assert (event["event"], event["path"], event["bytes"]) == ("file", str(path), path.stat().st_size)
            assert event["ended"] == "its limit of 0.5 MB is reached"
            assert 0.1e9 < event["t_ns"] < 5.1e9
            with pytest.raises(ControlError, match=r"its limit of 0.5 MB is reached; stored \d+ bytes, edges before"):
                control.call("vcd.stop")
        assert emulator.stop() == 0, "the limit is no fault"
    with Emulator("stream", cans=["none"], pace="step", seed=1) as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            control.call("vcd.start", path=str(tmp_path / "all.vcd"))
            control.call("run", for_s=5.1)
            control.call("vcd.stop")
    assert 498_000 < path.stat().st_size <= 500_000
    part, whole = read_vcd(path), read_vcd(tmp_path / "all.vcd")
    for name, wire in whole.wires.items():  # every edge before the closing time, at which it ends
        before = wire.t_ns < part.end_ns
        assert part.wires[name].t_ns.tolist() == wire.t_ns[before].tolist()
        assert part.wires[name].level.tolist() == wire.level[before].tolist()


def test_the_kernel_s_limit_of_a_file_is_not_called_the_recording_s(tmp_path: Path) -> None:
    with Emulator("stream", cans=["none"], pace="step") as emulator:
        resource.prlimit(emulator.pid, resource.RLIMIT_FSIZE, (400_000, 400_000))
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            control.call("vcd.start", path=str(tmp_path / "x.vcd"))
            control.call("run", for_s=5.0)
            with pytest.raises(ControlError, match=r"x.vcd: File too large; stored \d+ bytes"):
                control.call("vcd.stop")
        assert emulator.stop() == 3


@pytest.mark.parametrize(
    ("options", "status", "says"),
    [("size=4k", 3, "No space left on device; the file is not complete"), ("ro", 2, READ_ONLY)],
)
def test_a_resolved_scenario_that_cannot_be_stored_ends_the_emulator(
    options: str, status: int, says: str, disk: Path
) -> None:
    argv = [str(find_emulator()), "stream", "--can", "none", "--for", SHORT, "--resolved", str(disk / "r.json")]
    done = on_disk(options, disk, argv)
    assert done.returncode == status
    assert one_line(done.stderr, "psa-emu") == f"psa-emu: --resolved {disk / 'r.json'}: {says}"


def test_a_limit_of_no_bytes_is_no_death_by_signal(tmp_path: Path) -> None:
    argv = [
        "sh",
        "-c",
        'ulimit -f 0; exec "$@"',
        "sh",
        str(find_emulator()),
        "stream",
        "--can",
        "none",
        "--for",
        "10ms",
    ]
    argv += ["--resolved", str(tmp_path / "resolved.json")]
    done = subprocess.run(argv, capture_output=True, text=True, check=False, timeout=TIMEOUT_S, cwd=ROOT)
    assert done.returncode == 3
    assert "resolved.json: File too large" in one_line(done.stderr, "psa-emu")


def test_a_pipe_does_not_stop_the_emulator(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with Emulator("stream", cans=["none"], pace="step") as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            with pytest.raises(ControlError, match="pipe: expected a file, got a pipe"):
                control.call("vcd.start", path=str(tmp_path / "pipe"))
            control.call("time")


def test_the_longest_path_is_looked_at_whole(tmp_path: Path) -> None:
    folder = tmp_path
    while len(str(folder)) < 1200:
        folder /= "d" * 100
    folder.mkdir(parents=True)
    path = folder / "x.vcd"
    done = psa_emu("stream", "--can", "none", "--pace", "wall", "--for", "1.5s", "--vcd", path, "--quiet")
    assert (done.returncode, done.stderr) == (0, "")
    assert read_vcd(path).end_ns >= 1_500_000_000


@pytest.mark.parametrize("option", ["--help", "--version", "--list-commands", "--list-scenarios", "--dump"])
def test_a_full_standard_output_is_a_fault(option: str) -> None:
    with Path("/dev/full").open("w") as full_disk:
        argv = [str(find_emulator()), option]
        done = subprocess.run(argv, stdout=full_disk, stderr=subprocess.PIPE, text=True, check=False, cwd=ROOT)
    assert done.returncode == 3
    assert "stdout" in one_line(done.stderr, "psa-emu")


@pytest.mark.parametrize("size", ["size=4k", "ro"])
def test_a_snapshot_that_does_not_fit_leaves_nothing_and_is_an_error(size: str, disk: Path, tmp_path: Path) -> None:
    script = tmp_path / "snapshot.py"
    script.write_text(
        "import sys\nfrom psabench.bench import Bench\nfrom pathlib import Path\n"
        "with Bench.start('stream', pace='step') as bench:\n"
        "    disk = Path(sys.argv[1])\n"
        "    if sys.argv[2] != 'ro':\n        (disk / 'filler').write_bytes(b'x' * 4096)\n"
        "    try:\n        bench.snapshot(disk / 'x.psasnap')\n"
        "    except Exception as e:\n        print(type(e).__name__, e)\n"
        "print([p.name for p in disk.iterdir() if p.name != 'filler'])\n"
    )
    done = on_disk(size, disk, [sys.executable, script, disk, size])
    why = READ_ONLY if size == "ro" else "No space left on device"
    error, left = done.stdout.splitlines()
    assert error.startswith("ControlError")
    assert f"{disk}/x.psasnap: {why}" in error
    assert left == "[]"


# ---- files of the Python commands: recordings of frames are in tests/py/link/test_log_file.py


def psabench_on(options: str, disk: Path, *args: str | Path) -> subprocess.CompletedProcess[str]:
    return on_disk(options, disk, [PSABENCH, *args])


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "bus.log"
    assert psa_emu("stream", "--can", f"log:{path}", "--pace", "free", "--for", "10s", "--quiet").returncode == 0
    return path


COMMANDS: dict[str, Callable[[Path, Path], list[str | Path]]] = {
    "decode": lambda log, disk: ["decode", log, "--out", disk / "run.csv"],
    "run": lambda log, disk: ["run", "fourier", "--average", "0", "--realisations", "200", "--out", disk],
    "campaign": lambda log, disk: ["campaign", "gyrocompass", "--runs", "20000", "--workers", "1", "--out", disk],
}


@pytest.mark.parametrize("command", sorted(COMMANDS))
@pytest.mark.parametrize(("options", "status"), [("size=32k", 3), ("ro", 2)])
def test_a_command_names_the_file_that_a_disk_does_not_take(
    command: str, options: str, status: int, log: Path, disk: Path
) -> None:
    done = psabench_on(options, disk, *COMMANDS[command](log, disk))
    assert "Traceback" not in done.stderr
    assert done.returncode == status, done.stderr
    line = done.stderr.splitlines()[-1]
    assert re.match(rf"psabench: (psa-emu: --resolved )?{disk}", line)
    why = "No space left on device|database or disk is full|disk I/O error"
    assert re.search(why if status == 3 else "got a read-only file system|unable to open database file", line)


def write_text(path: Path) -> None:
    with output_text(path) as out:
        out.write("a\n")
        path.unlink()


def write_store(path: Path) -> None:
    origin = Origin(kind="dice", input={}, seed=1, version="1", build="b", columns=("x",))
    with Store(path) as store:
        store.put([Part(origin=origin, first_run=0, rows=np.zeros((3, 1), np.float32))])
        path.unlink()
        store.put([Part(origin=origin, first_run=3, rows=np.zeros((3, 1), np.float32))])


@pytest.mark.parametrize("write", [write_text, write_store])
def test_a_file_of_python_that_goes_under_way_is_told(write: Callable[[Path], None], tmp_path: Path) -> None:
    path = tmp_path / "file"
    with pytest.raises(BenchError, match=f"{path}: moved, removed or replaced while it was written") as e:
        write(path)
    assert e.value.exit_status == 3


@pytest.mark.parametrize("error", [BrokenPipeError(), TimeoutError("slow"), KeyboardInterrupt()])
def test_an_error_of_another_thing_is_not_the_file_s(error: BaseException, tmp_path: Path) -> None:
    def write() -> None:
        with output_text(tmp_path / "file") as out:
            out.write("a\n")
            raise error

    with pytest.raises(type(error)) as e:
        write()
    assert e.value is error
    assert (tmp_path / "file").read_text() == "a\n"


def test_a_log_is_not_decoded_into_itself(log: Path) -> None:
    before = log.read_bytes()
    done = subprocess.run([PSABENCH, "decode", log, "--out", log], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "--out: expected another file than the one that is read" in one_line(done.stderr, "psabench")
    assert log.read_bytes() == before


def test_a_text_file_has_one_owner_and_the_emulator_s_is_one(tmp_path: Path) -> None:
    path = tmp_path / "file"
    owned = Owned(path)
    with pytest.raises(BenchError, match=f"expected a file that no other process writes, got one of pid {os.getpid()}"):
        output_text(path).__enter__()
    done = psa_emu("stream", "--can", "none", "--vcd", path, "--for", SHORT)
    assert done.returncode == 2
    assert done.stderr.endswith(f"got one of pid {os.getpid()}\n")
    done = psa_emu("stream", "--can", "none", "--resolved", path, "--for", SHORT)
    assert (done.returncode, done.stdout) == (2, "")
    owned.release()
    assert psa_emu("stream", "--can", "none", "--vcd", path, "--for", SHORT, "--quiet").returncode == 0


def test_a_space_in_a_path_stays_in_it(tmp_path: Path) -> None:
    """In the ready lines, in `endpoints`, and in those of a fork."""
    folder = tmp_path / 'my "run" \\ 1'
    folder.mkdir()
    paths = {"vcd": folder / "x.vcd", "log": folder / "bus.log", "link": folder / "serial"}
    extra: list[str | Path] = ["--vcd", paths["vcd"], "--can", f"log:{paths['log']}"]
    with Emulator("calibrate", cans=[f"slcan:{paths['link']}"], extra=extra) as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            told = control.call("endpoints").result["endpoints"]
            made = control.call("fork", control=str(folder / "fork"), can="none").result
            with Control(folder / "fork") as fork:
                assert fork.call("endpoints").result["endpoints"] == made["endpoints"]
                fork.call("quit")
        assert told == emulator.endpoints
        for key, path in paths.items():
            assert emulator.endpoint(**{key: str(path)})[key] == str(path)
        assert made["endpoints"] == [{"control": str(folder / "fork")}]
