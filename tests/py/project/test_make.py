"""What make promises besides building: help, an install that runs where it is put, set-up without rights."""

import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
ENV = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
INTERNAL = {"cli", "FORCE", "alarms", "bench-bin", "e2e-vcan", "e2e-slc0", "fuzz-bin", "fuzz-each"}  # parts of others


def make(*args: str) -> str:
    done = subprocess.run(["make", "--no-print-directory", *args], cwd=ROOT, env=ENV, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_help_has_a_line_for_every_target() -> None:
    makefile = (ROOT / "Makefile").read_text()
    phony = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)
    assert phony is not None
    shown = {line.split()[0] for line in make("help").splitlines()}
    assert set(phony.group(1).split()) - INTERNAL == shown - {"compile_commands.json"}


def test_an_installed_emulator_finds_its_files_and_leaves_none_behind(tmp_path: Path) -> None:
    where = ["DESTDIR=" + str(tmp_path / "stage"), "PREFIX=/opt/psa"]
    make("install", *where)
    emulator = tmp_path / "stage/opt/psa/bin/psa-emu"
    done = subprocess.run(
        [emulator, "quiet", "--pace", "free", "--for", "5ms"], cwd=tmp_path, capture_output=True, text=True, timeout=30
    )
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "ready all"), done.stderr
    assert (tmp_path / "stage/opt/psa/share/psabench/decoders/psa2frame/pd.py").exists()
    sigrok = tmp_path / "stage/opt/psa/share/libsigrokdecode/decoders"  # in XDG_DATA_DIRS when PREFIX is /usr/local
    assert {p.parent.name for p in sigrok.glob("*/pd.py")} == {p.parent.name for p in ROOT.glob("decoders/*/pd.py")}
    assert (sigrok / "ads1256/__init__.py").exists()
    others = sigrok / "uart/pd.py"  # of the distribution, say
    others.parent.mkdir()
    others.touch()
    make("uninstall", *where)
    others.unlink()  # was left alone
    assert [p for p in (tmp_path / "stage").rglob("*") if not p.is_dir()] == []


@pytest.mark.skipif(os.getuid() != 0, reason="drops root's rights to see what set-up says without them")
def test_set_up_without_rights_says_in_two_lines_what_to_install(shared_path: Path) -> None:
    tools = shared_path / "repo/tools"
    programs = shared_path / "bin"
    tools.mkdir(parents=True)
    programs.mkdir()
    (tools / "setup").write_bytes((ROOT / "tools/setup").read_bytes())
    for name in ("bash", "dirname", "id", "cat", "apt-get"):  # a machine without a compiler, Python and sudo
        (programs / name).symlink_to(f"/usr/bin/{name}")
    for path in [shared_path, *shared_path.rglob("*")]:
        path.chmod(0o755)
    done = subprocess.run(
        [
            "/usr/bin/setpriv",
            "--reuid=65534",
            "--regid=65534",
            "--clear-groups",
            "/usr/bin/bash",
            tools / "setup",
            "run",
        ],
        env={"PATH": str(programs)},
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("setup: as root, run: apt-get install build-essential pkg-config")
    assert not (shared_path / "repo/.venv").exists()
