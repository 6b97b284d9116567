"""Recordings on a full disk, in a file that is removed or that another process writes: nothing is lost in silence."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from hashlib import sha256
from pathlib import Path

import can
import pytest
from psabench.conform.sources import mf4
from psabench.errors import BadInput
from psabench.link.log_file import FORMATS, LogFile
from psabench.logs.formats import read_frames

MESSAGES = 10_000
WITH_MF4 = pytest.mark.skipif(not mf4.asammdf_is_there(), reason="asammdf is not there: make setup")
EVERY = [pytest.param(ending, marks=WITH_MF4) if ending == ".mf4" else ending for ending in FORMATS]
READABLE = [ending for ending in EVERY if ending != ".txt"]  # printed messages: nothing reads them back
SIZE = 128 * 1024

# Records MESSAGES of them, with a look at the file after each hundred; says what it counted.
WRITE = f"""
import json, resource, sys
from hashlib import sha256
from pathlib import Path
import can
from psabench.link.log_file import LogFile
if "limit" in sys.argv:  # after the imports: Python 3.11 keeps a .pyc that a limit has cut
    resource.setrlimit(resource.RLIMIT_FSIZE, ({SIZE}, {SIZE}))
log = LogFile(Path(sys.argv[1]))
given = 0
for n in range({MESSAGES}):
    data = sha256(b"%d" % n).digest()[:8]
    given += 1
    if not log(can.Message(arbitration_id=n % 2048, data=data, is_extended_id=False, timestamp=1e9 + n * 1e-3)):
        break
    if n == 5_000 and "remove" in sys.argv:
        Path(sys.argv[1]).unlink()
    if n % 100 == 0 and not log.check():
        break
stored = log.close()
print(json.dumps([given, stored, str(log.error), log.error.exit_status if log.error else 0]))
"""


def counted(command: Sequence[str], ending: str) -> tuple[int, int, str, int]:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    given, stored, error, status = json.loads(done.stdout.splitlines()[-1])
    return int(given), int(stored), str(error), int(status)


def read_back(path: Path) -> Iterator[tuple[int, bytes, float]]:
    for m in read_frames(path):
        yield m.arbitration_id, bytes(m.data), m.timestamp


def assert_the_first(path: Path, stored: int) -> None:
    """The file holds the first messages, as many as were counted, with their stamps."""
    messages = list(read_back(path))
    assert len(messages) == stored
    for n, (can_id, data, t_s) in enumerate(messages):
        assert (can_id, data) == (n % 2048, sha256(b"%d" % n).digest()[:8])
        assert t_s - messages[0][2] == pytest.approx(n * 1e-3, abs=2e-3)


@pytest.mark.parametrize("ending", READABLE)
def test_a_file_that_may_not_grow_holds_what_was_counted(tmp_path: Path, ending: str) -> None:
    """A limit of the process, which everybody can set, in place of a full disk."""
    path = tmp_path / f"bus{ending}"

    given, stored, error, status = counted([sys.executable, "-c", WRITE, str(path), "limit"], ending)
    assert status == 3
    assert error.startswith(f"{path}: ")
    assert 0 <= stored < given
    if stored or ending != ".mf4":  # which is written at the end, or not at all
        assert_the_first(path, stored)
        assert stored > 300


FULL_DISK = f"mount -t tmpfs -o size={SIZE} none $1 && $2 -c '{WRITE}' $1/bus$3 && cp $1/bus$3 $4"


@pytest.mark.parametrize("ending", READABLE)
def test_a_full_disk_ends_a_recording_that_holds_what_was_counted(tmp_path: Path, ending: str) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    user = ["unshare", "--user", "--map-root-user", "--mount"]
    if subprocess.run([*user, "mount", "-t", "tmpfs", "none", str(disk)], capture_output=True).returncode != 0:
        pytest.skip("no mount in a namespace of one's own: no disk to fill")
    kept = tmp_path / f"kept{ending}"
    given, stored, error, status = counted(
        [*user, "sh", "-ec", FULL_DISK, "sh", str(disk), sys.executable, ending, str(kept)],
        ending,
    )
    assert status == 3
    assert error.startswith(f"{disk}/bus{ending}: ")
    assert 300 < stored <= given < MESSAGES
    assert_the_first(kept, stored)


@pytest.mark.parametrize("ending", EVERY)
def test_a_file_that_is_removed_ends_the_recording(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"bus{ending}"
    given, stored, error, status = counted([sys.executable, "-c", WRITE, str(path), "remove"], ending)
    assert (given, stored, status) == (5_001, 0, 3)
    assert error == f"{path}: moved, removed or replaced while it was written"


@pytest.mark.parametrize("ending", sorted(set(FORMATS) - {".mf4"}))
def test_a_second_process_is_refused_by_name(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"bus{ending}"
    log = LogFile(path)
    log(can.Message(timestamp=1.0))
    second = (
        "import sys; from pathlib import Path; from psabench.link.log_file import LogFile; LogFile(Path(sys.argv[1]))"
    )
    done = subprocess.run([sys.executable, "-c", second, str(path)], capture_output=True, text=True)
    assert f"{path}: expected a file that no other process writes, got one of pid {os.getpid()}" in done.stderr
    assert log.close() == 1


@pytest.mark.parametrize("path", ["/nowhere/bus.log", "/proc/bus.log", "/bus.xyz", "/"])
def test_a_path_that_cannot_be_written_is_the_user_s(path: str) -> None:
    with pytest.raises(BadInput, match=path):
        LogFile(Path(path))
