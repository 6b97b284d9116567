"""tests/uml/run is honest: the job's own exit status and output, never success for a guest that died."""

import os
import pty
import shutil
import subprocess
import threading
import tty
from pathlib import Path

import pytest

RUN = Path(__file__).parents[2] / "uml" / "run"

pytestmark = pytest.mark.skipif(shutil.which("linux.uml") is None, reason="no user-mode kernel installed here")


def run_job(tmp_path: Path, script: str, *args: str, options: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    job = tmp_path / "job.sh"
    job.write_text(f"#!/bin/sh\n{script}\n")
    job.chmod(0o755)
    return subprocess.run([RUN, *options, job, *args], capture_output=True, text=True, timeout=90)


@pytest.mark.parametrize(
    ("what", "script", "status"),
    [
        ("success", "exit 0", 0),
        ("the job's own failure", "exit 3", 3),
        ("a job that is killed", "kill -KILL $$", 128 + 9),
        ("a job that kills all it can reach", "kill -KILL -1; exit 0", 128 + 9),
        ("a job that dies with its kernel", "echo c >/proc/sysrq-trigger; sleep 9; exit 0", 125),
        ("a job that powers the guest off", "echo o >/proc/sysrq-trigger; sleep 9; exit 0", 125),
    ],
)
def test_exit_status_is_the_jobs_or_a_failure(tmp_path: Path, what: str, script: str, status: int) -> None:
    assert run_job(tmp_path, script).returncode == status, what


def test_a_job_past_its_time_is_ended(tmp_path: Path) -> None:
    assert run_job(tmp_path, "sleep 60", options=("--timeout", "1")).returncode == 124


def test_the_last_words_of_a_dying_kernel_are_shown(tmp_path: Path) -> None:
    assert "without an exit status" in run_job(tmp_path, "echo c >/proc/sysrq-trigger; sleep 9").stderr


def test_output_and_arguments_pass_unchanged(tmp_path: Path) -> None:
    done = run_job(tmp_path, 'printf "%s|" "$@"; echo; seq 1 5000; echo err >&2', "a b", "it's", "$HOME", "")
    assert done.stdout == "a b|it's|$HOME||\n" + "".join(f"{n}\n" for n in range(1, 5001)) + "err\n"


def test_the_guest_has_can_the_repository_and_its_python(tmp_path: Path) -> None:
    done = run_job(
        tmp_path, "ls Makefile; cat /sys/class/net/vcan0/mtu; python -c 'import can, sys; print(sys.prefix)'"
    )
    assert done.stdout.splitlines() == ["Makefile", "72", str(RUN.parents[2] / ".venv")]


def test_an_unprivileged_user_may_run_it(shared_path: Path) -> None:
    if os.getuid() != 0:
        pytest.skip("every other test here runs as an ordinary user already")
    # pytest's own folder is closed to others, and so may the repository's be.
    shutil.copytree(RUN.parent, shared_path / "repo/tests/uml")
    script = shared_path / "repo/job.sh"
    script.write_text("#!/bin/sh\nid -u; cat /sys/class/net/vcan0/mtu; exit 4\n")
    for path in [shared_path, *shared_path.rglob("*")]:
        path.chmod(0o777)
    done = subprocess.run(
        [
            "setpriv",
            "--reuid=65534",
            "--regid=65534",
            "--clear-groups",
            shared_path / "repo/tests/uml/run",
            script,
        ],
        capture_output=True,
        text=True,
        timeout=90,
    )
    assert (done.returncode, done.stdout.splitlines()) == (4, ["0", "72"]), done.stderr


def test_serial_bridges_a_pty_both_ways(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)

    def answer() -> None:
        got = b""
        while not got.endswith(b"\r"):
            got += os.read(ours, 64)
        os.write(ours, got.upper())

    peer = threading.Thread(target=answer, daemon=True)
    peer.start()
    try:
        done = run_job(
            tmp_path,
            'stty -F "$PSA_SERIAL" raw -echo; exec 3<>"$PSA_SERIAL"\n'
            'printf "t1232beef\\r" >&3; head -c 10 <&3 | tr "\\r" .',
            options=("--serial", os.ttyname(theirs)),
        )
        peer.join(5)
    finally:
        os.close(ours)
        os.close(theirs)
    assert (done.returncode, done.stdout) == (0, "T1232BEEF."), done.stderr


@pytest.mark.parametrize("args", [[], ["--no-such-option", "x"], ["/nonexistent/job"], [str(RUN.parent / "xstate.c")]])
def test_a_bad_call_is_refused_in_one_line(args: list[str]) -> None:
    done = subprocess.run([RUN, *args], capture_output=True, text=True, timeout=10)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("status", [0, 3])
def test_a_kernel_with_can_is_used_itself(tmp_path: Path, status: int) -> None:
    """The way on this kernel, with stand-ins for what this machine may lack: the namespace and the interface."""
    for name, script in {"unshare": 'shift; exec "$@"', "ip": 'echo "$*" >>"$IP_LOG"'}.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / name).chmod(0o755)
    job = tmp_path / "job.sh"
    job.write_text(f'#!/bin/sh\necho "$1 $PSABENCH_GUEST"; exit {status}\n')
    job.chmod(0o755)
    done = subprocess.run(
        [RUN.with_name("native"), "--timeout", "20", job, "x"],
        # .venv/bin comes first in the job's path and holds neither name.
        env=os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "IP_LOG": str(tmp_path / "log")},
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.returncode == status, done.stderr
    assert "taking this kernel's vcan" in done.stdout
    assert done.stdout.splitlines()[-1] == "x native"
    assert (tmp_path / "log").read_text().splitlines()[-1] == "link set vcan0 up"
