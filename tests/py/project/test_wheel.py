"""The wheel of this checkout, in an environment of its own and an empty folder: emulator, library and data come along.

The environment sees the packages of .venv (numpy and so on) but not the psabench there, so that no network is needed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
UV = str(Path(sys.executable).with_name("uv"))
ENV = {
    k: v
    for k, v in os.environ.items()
    if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "PYTHONPATH", "PSA_EMU", "PSABENCH_LIB", "PSABENCH_PROTO")
} | {"PYTHONDONTWRITEBYTECODE": "1"}  # the environment is gone after the tests: nothing of it in build/pycache


def run(command: Sequence[str | Path], cwd: Path, timeout_s: float = 100.0) -> str:
    done = subprocess.run(command, cwd=cwd, env=ENV, capture_output=True, text=True, timeout=timeout_s)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def build() -> Path:
    run(["make", "--no-print-directory", "wheel"], ROOT)
    return max((ROOT / "build/dist").glob("psabench-*.whl"), key=lambda p: p.stat().st_mtime_ns)


@pytest.fixture(scope="module")
def wheel() -> Path:
    return build()


@pytest.fixture(scope="module")
def programs(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """bin of a new environment with the wheel in it."""
    venv = tmp_path_factory.mktemp("wheel") / "venv"
    run([UV, "venv", "-q", "--offline", "--python", sys.executable, venv], ROOT)
    python = venv / "bin/python"
    run([UV, "pip", "install", "-q", "--offline", "--no-deps", "--python", python, wheel], ROOT)
    site = run([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], venv).strip()
    # A line of a .pth is a folder to import from; the .pth files there, our editable install's too, are not read.
    (Path(site) / "packages_of_the_checkout.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return venv / "bin"


def test_it_is_for_any_python_3_on_this_platform(wheel: Path) -> None:
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert wheel.name.endswith(f"-py3-none-{platform}.whl")


def test_the_same_sources_make_the_same_wheel(wheel: Path) -> None:
    first = wheel.read_bytes()
    (package,) = (ROOT / "build/wheel").glob("lib*/psabench")
    (package / "of_an_earlier_version.py").touch()
    assert build().read_bytes() == first


def test_it_holds_what_is_installed_and_no_path_of_this_machine(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as z:
        files = {n.removeprefix("psabench/bundle/"): z.read(n) for n in z.namelist() if "/bundle/" in n}
        panel = {n.removeprefix("psabench/panel/static/") for n in z.namelist()}
        ours = [n for n, data in files.items() if str(ROOT).encode() in data]
    assert ours == []
    assert {"index.html", "main.js", "panel.css", "uPlot.iife.min.js", "uPlot.min.css", "uPlot.LICENSE"} <= panel
    libraries = {"lib/libpsabench.so.0", "lib/libpsabench-nav.so.1"}
    assert libraries | {"bin/psa-emu", "include/psabench.h", "share/psabench/proto/psabench.dbc"} <= set(files)
    for folder in ("proto", "decoders", "share"):
        here = {p for p in (ROOT / folder).rglob("*") if p.is_file() and p.suffix != ".pyc"}
        assert {f"share/psabench/{p.relative_to(ROOT)}" for p in here} <= set(files)


def test_it_brings_the_manual_pages_and_the_completion_that_make_install_brings(wheel: Path, programs: Path) -> None:
    run(["make", "-s", "cli"], ROOT)
    share = programs.parent / "share"
    places = {
        ".1": "man/man1/{}.1",
        ".bash": "bash-completion/completions/{}",
        ".zsh": "zsh/site-functions/_{}",
        ".fish": "fish/vendor_completions.d/{}.fish",
    }
    for command in ("psabench", "psa-emu"):
        for ending, place in places.items():
            made = (ROOT / "build/cli" / f"{command}{ending}").read_bytes()
            assert (share / place.format(command)).read_bytes() == made
    with zipfile.ZipFile(wheel) as z:
        assert [n for n in z.namelist() if "/bundle/share/" in n and "/share/psabench/" not in n] == []
    found = run(["man", "-w", "-M", share / "man", "psabench"], ROOT).strip()
    assert found == str(share / "man/man1/psabench.1")


def test_the_command_runs_a_procedure_on_its_own_emulator(programs: Path, tmp_path: Path) -> None:
    assert "psabench run all" in run([programs / "psabench", "--help"], tmp_path)
    said = run([programs / "psabench", "run", "turns", "--condition", "quiet"], tmp_path)
    assert "numbers are within 2 U of the sensor's true parameters" in said
    assert (tmp_path / "build/run/report.html").is_file()


def test_the_emulator_is_a_command_too(programs: Path, tmp_path: Path) -> None:
    said = run([programs / "psa-emu", "quiet", "--pace", "free", "--for", "5ms"], tmp_path, timeout_s=30)
    assert said.splitlines()[-1] == "ready all"


def test_the_emulator_needs_no_library_but_libc_of_the_machine(programs: Path) -> None:
    (emulator,) = programs.parent.glob("lib/python3*/site-packages/psabench/bundle/bin/psa-emu")
    loaded = dict(re.findall(r"^\s*(\S+) => (\S+)", run(["ldd", emulator], programs), re.MULTILINE))
    foreign = {name for name, path in loaded.items() if not Path(path).resolve().is_relative_to(programs.parent)}
    assert foreign == {"libc.so.6", "libm.so.6"}
    assert {"libcjson.so.1", "libfyaml.so.0"} <= set(loaded)


def test_python_uses_its_own_emulator_library_and_files(programs: Path, tmp_path: Path) -> None:
    script = (
        "import psabench.chips as c, psabench.native.clib as l, psabench.native.navlib as n, psabench.places as p\n"
        "print(p.find_emulator(), l.library().path, n.library().path, p.proto_file('psabench.dbc'), sep='\\n')\n"
        "with c.Bench() as b:\n"
        "    adc = b.part('ads1256')\n"
        "    adc.run_until_level('DRDY', 0)\n"
        "    print(b.now_ns > 0)\n"
    )
    *places, moved = run([programs / "python", "-c", script], tmp_path).splitlines()
    assert moved == "True"
    assert [p for p in places if not Path(p).is_relative_to(programs.parent)] == []


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The unpacked sdist."""
    out = tmp_path_factory.mktemp("sdist")
    # Of an earlier build, whose files setuptools would pack again.
    (ROOT / "scripts/psabench.egg-info/SOURCES.txt").unlink(missing_ok=True)
    run(
        [UV, "build", "-q", "--sdist", "--no-build-isolation", "--offline", "--python", sys.executable, "-o", out], ROOT
    )
    (archive,) = out.glob("psabench-*.tar.gz")
    shutil.unpack_archive(archive, out, filter="data")
    return out / archive.name.removesuffix(".tar.gz")


def test_the_sdist_has_the_sources_of_what_make_installs(sdist: Path) -> None:
    folders = ["decoders", "emu", "nav", "proto", "share", "tools", "scripts/psabench"]
    kept = run(["git", "ls-files", *folders], ROOT).split()
    assert {f for f in kept if not (sdist / f).exists()} == set()
    settings = [f"PY={sys.executable}", "CLI=", "DESTDIR=", f"PREFIX={sdist}/usr"]
    # Generates the sources, says the rest: what is missing to compile is an error.
    assert "emu/app/main.c" in run(["make", "-n", *settings, "install"], sdist)


def test_a_build_from_the_sdist_names_what_is_missing_in_one_line(sdist: Path, tmp_path: Path) -> None:
    command: list[str | Path] = [
        UV,
        "build",
        "--wheel",
        "--no-build-isolation",
        "--offline",
        "--python",
        sys.executable,
        "-o",
        tmp_path,
    ]
    env = ENV | {"PKG_CONFIG_LIBDIR": str(tmp_path)}  # no library is known there
    done = subprocess.run([*command, sdist], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=60)
    assert done.returncode != 0
    lines = [line.strip() for line in done.stderr.splitlines() if "psabench: " in line]
    libraries = "libcjson-dev libfyaml-dev libeigen3-dev"
    listed = libraries.replace(" ", ", ")
    assert lines == [f"psabench: build: expected {listed}, got none; apt-get install {libraries}"]
