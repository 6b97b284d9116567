"""MF4 logs, made safe: a process of its own makes a log of candump of one, within bounds of memory and time.

python-can reads them by asammdf, which follows any address that is in a file, in circles, too. As python-can loads
asammdf whenever it is loaded itself, which takes seconds, asammdf may be in a folder that this process alone looks
into.
"""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import IO, TextIO

from psabench.errors import expected

FOLDER = Path(sys.prefix) / "mf4"  # tools/setup puts asammdf there
BEGINS = (b"MDF     ", b"UnFinMF ")  # the second: no one closed it
MOST_MEMORY = 2 << 30  # bytes of that process
MOST_CPU_S = 60  # of reading
MOST_LOG = 1 << 30  # bytes
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "NUMEXPR_NUM_THREADS": "1"}  # each more would reserve memory


def asammdf_is_there() -> bool:
    """In the folder, or where Python itself looks."""
    return (FOLDER / "asammdf").is_dir() or find_spec("asammdf") is not None


def candump_of(path: Path, max_s: float, most_frames: int) -> tuple[IO[bytes], str]:
    """The same frames as lines of candump, and why there are no more ("": all are there, or one more than asked for).

    Raises ValueError for what is no MF4 file and where asammdf is missing, OSError.
    """
    with path.open("rb") as file:
        if file.read(8) not in BEGINS:
            raise ValueError(expected("MDF at the beginning", "another file"))
    if not asammdf_is_there():
        raise ValueError(
            expected(f"asammdf (pip install asammdf), or can_logconvert {path.name} {path.stem}.log", "none")
        )
    log = tempfile.TemporaryFile()  # noqa: SIM115 (the reader closes it)
    with (
        tempfile.TemporaryDirectory() as scratch,
        tempfile.TemporaryFile() as words,
    ):  # asammdf copies what no one closed
        bounds = [str(n) for n in (max_s, most_frames, MOST_MEMORY, MOST_CPU_S)]
        status = subprocess.run(
            [sys.executable, "-P", "-W", "ignore", __file__, str(path), *bounds],
            env=os.environ | ONE_THREAD | {"TMPDIR": scratch, "PYTHONPATH": search_path()},
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=words,
            check=False,
        ).returncode
        trouble = _trouble(status, words)
    _leave_whole_lines(log)
    return log, trouble


def search_path() -> str:
    return os.pathsep.join(filter(None, (str(FOLDER), os.environ.get("PYTHONPATH", ""))))


def _trouble(status: int, words: IO[bytes]) -> str:
    if not status:
        return ""
    if status == -signal.SIGXCPU:
        return f"asammdf took more than {MOST_CPU_S} s over it"
    if status < 0:
        return f"asammdf was ended by {signal.Signals(-status).name}"
    words.seek(max(0, words.seek(0, os.SEEK_END) - 4096))
    said = words.read().decode(errors="replace").splitlines()
    return f"asammdf cannot read it ({said[-1][:160] if said else f'exit status {status}'})"


def _leave_whole_lines(log: IO[bytes]) -> None:
    """Who is ended while writing leaves a line without an end."""
    size = log.seek(0, os.SEEK_END)
    begin = log.seek(max(0, size - 4096))
    log.truncate(begin + log.read().rfind(b"\n") + 1)
    log.seek(0)


def _convert(path: str, max_s: float, most_frames: int, out: TextIO) -> None:
    """In the process of its own. One frame beyond a bound is written, so that the reader sees that there are more."""
    import can

    first_s = None
    writer = can.CanutilsLogWriter(out)
    with can.MF4Reader(path) as frames:
        for n, m in enumerate(frames):
            writer.last_timestamp = None  # else one that goes back would be set right
            writer(m)
            first_s = m.timestamp if first_s is None else first_s
            if n >= most_frames or m.timestamp - first_s > max_s:
                break
    writer.stop()


def limit(what: int, most: int) -> None:
    hard = resource.getrlimit(what)[1]
    resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _main(path: str, *bounds: str) -> None:
    """Ends the process at once, so that the last that it says is why it failed."""
    max_s, (most_frames, memory, cpu_s) = float(bounds[0]), map(int, bounds[1:])
    import can  # before the bounds: how long it takes to load is not the file's doing  # noqa: F401

    out, sys.stdout = sys.stdout, sys.stderr
    used = resource.getrusage(resource.RUSAGE_SELF)
    cpu_s += round(used.ru_utime + used.ru_stime) + 1
    limit(resource.RLIMIT_AS, memory)
    limit(resource.RLIMIT_CPU, cpu_s)
    limit(resource.RLIMIT_FSIZE, MOST_LOG)
    limit(resource.RLIMIT_CORE, 0)
    try:
        _convert(path, max_s, most_frames, out)
    except Exception as e:  # asammdf raises whatever its parsing comes to
        print(f"{type(e).__name__}: {' '.join(str(e).split())}", flush=True)
        os._exit(1)
    os._exit(0)


if __name__ == "__main__":
    _main(*sys.argv[1:])
