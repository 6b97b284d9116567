"""libpsabench as a stranger gets it: exports, versions, an installation that programs are built against, its page."""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest
from psabench import places
from psabench.chips import Bench, parts
from psabench.errors import BadInput
from psabench.link.vcd import read_vcd
from psabench.native import clib
from psabench.native.navlib import NavLibrary
from psabench.native.navlib import library as nav_library
from psabench.report.waveform import rdata_picture

ROOT = Path(__file__).parents[3]
ENV = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
HEADER = "".join((ROOT / "emu/api" / name).read_text() for name in ("psabench.h", "psabench_models.h"))
NAV_HEADERS = "".join(path.read_text() for path in sorted((ROOT / "nav").glob("*.h")))
PAGE = ROOT / "docs/library.md"
EXAMPLES = ("ads1256_read", "ads1282_read", "ad7712_read", "psa2_frames")
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wundef", "-Werror"]


def run(command: Sequence[str | Path], **environment: str) -> str:
    done = subprocess.run(
        command, cwd=ROOT, env=ENV | environment, capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}"
    return done.stdout


def declared() -> set[str]:
    return set(re.findall(r"^PSABENCH_API [^;]*?\b(psabench_\w+)\(", HEADER, re.MULTILINE))


def declared_of_nav() -> set[str]:
    return set(re.findall(r"^NAV_API [^;]*?\b(nav_\w+)\(", NAV_HEADERS, re.MULTILINE))


def defined(*nm: str | Path) -> set[str]:
    lines = [line.split() for line in run(["nm", "-g", "--defined-only", *nm]).splitlines()]
    return {f[2] for f in lines if len(f) == 3}


# ---- what the built library is ----


def test_the_shared_library_exports_what_the_header_declares_and_nothing_else() -> None:
    assert len(declared()) > 30
    assert defined("-D", ROOT / "build/libpsabench.so.0") == declared()


def test_the_static_library_has_no_other_names_either() -> None:
    assert defined(ROOT / "build/libpsabench.a") == declared()


def test_the_library_says_its_name_and_needs_only_libc() -> None:
    dynamic = run(["readelf", "-d", ROOT / "build/libpsabench.so.0"])
    assert "Library soname: [libpsabench.so.0]" in dynamic
    needed = set(re.findall(r"Shared library: \[([^]]*)\]", dynamic))
    assert needed <= {"libc.so.6", "libm.so.6"}


def test_there_is_one_version_and_one_abi_number() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    so = ctypes.CDLL(str(ROOT / "build/libpsabench.so.0"))
    so.psabench_version.restype = ctypes.c_char_p
    assert so.psabench_version().decode() == version
    assert f"\nVersion: {version}\n" in (ROOT / "build/psabench.pc").read_text()
    assert version in run([ROOT / "build/psa-emu", "--version"])
    macro = re.search(r"^#define PSABENCH_ABI (\d+)$", HEADER, re.MULTILINE)
    assert macro is not None
    assert (so.psabench_abi(), (ROOT / "build/libpsabench.so").resolve().name) == (
        int(macro[1]),
        f"libpsabench.so.{macro[1]}",
    )


def test_the_navigation_library_exports_its_headers_and_needs_no_runtime_of_another_language() -> None:
    assert len(declared_of_nav()) > 20
    assert defined("-D", ROOT / "build/libpsabench-nav.so.1") == declared_of_nav()
    assert defined(ROOT / "build/libpsabench-nav.a") == declared_of_nav()
    assert {f"nav_{name}" for name in NavLibrary.prototypes} == declared_of_nav()
    dynamic = run(["readelf", "-d", ROOT / "build/libpsabench-nav.so.1"])
    assert "Library soname: [libpsabench-nav.so.1]" in dynamic
    assert set(re.findall(r"Shared library: \[([^]]*)\]", dynamic)) <= {"libc.so.6", "libm.so.6"}
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert re.fullmatch(re.escape(version) + r" eigen-\d+\.\d+\.\d+", nav_library().version().decode())
    assert f"\nVersion: {version}\n" in (ROOT / "build/psabench-nav.pc").read_text()


# ---- what Python declares of it ----


C_TYPES: dict[str, object] = {
    "void": None,
    "int": ctypes.c_int,
    "unsigned": ctypes.c_uint,
    "uint8_t": ctypes.c_uint8,
    "uint32_t": ctypes.c_uint32,
    "uint64_t": ctypes.c_uint64,
    "int64_t": ctypes.c_int64,
    "size_t": ctypes.c_size_t,
    "double": ctypes.c_double,
    "double *": ctypes.POINTER(ctypes.c_double),
    "char *": ctypes.c_char_p,
    "uint8_t *": ctypes.c_void_p,
    "uint64_t *": ctypes.POINTER(ctypes.c_uint64),
    "psabench *": ctypes.c_void_p,
    "psabench_part *": ctypes.c_void_p,
    "void *": ctypes.c_void_p,
    "psabench_watch_fn *": clib.WATCH,
    "psabench_interrupt_fn *": clib.INTERRUPT,
    "psabench_deadline_fn *": clib.DEADLINE,
    "psabench_input_fn *": clib.INPUT,
    "psabench_frame_fn *": clib.FRAME,
    "psabench_quartz_job *": ctypes.POINTER(clib.QuartzJobStruct),
    "psabench_flight_job *": ctypes.POINTER(clib.FlightJobStruct),
    "psabench_flight *": ctypes.c_void_p,
    "int64_t *": ctypes.POINTER(ctypes.c_int64),
}
TX = {
    "spi": (1, ctypes.c_char_p),
    "play_bits": (1, ctypes.c_char_p),
}  # bytes go in as they are; ctypes has no other type for that


def c_type(words: str) -> object:
    words = re.sub(r"\bconst\b|\bstruct\b", "", words).strip()
    named = re.fullmatch(r"(.*?[\s*])\w+", words)  # without the argument's name
    return C_TYPES[re.sub(r"\s*\*", " *", (named[1] if named and words not in C_TYPES else words).strip())]


def test_every_function_of_the_header_is_declared_as_it_is_there() -> None:
    text = re.sub(r"/\*.*?\*/", "", HEADER, flags=re.DOTALL)
    found: dict[str, tuple[object, ...]] = {}
    for result, name, arguments in re.findall(r"^PSABENCH_API (.*?)psabench_(\w+)\((.*?)\);", text, re.M | re.S):
        listed = [] if arguments == "void" else [c_type(a) for a in arguments.split(",")]
        if name in TX:
            at, kind = TX[name]
            listed[at] = kind
        found[name] = (c_type(f"{result}x"), *listed)
    assert len(found) > 25
    assert found == clib.PROTOTYPES


def test_the_frame_has_the_layout_of_the_header(tmp_path: Path) -> None:
    names = [name for name, *_ in clib.FrameStruct._fields_]
    rows = "".join(
        f'printf("%zu %zu\\n", offsetof(struct psabench_frame, {n}), sizeof((struct psabench_frame *)0)->{n});'
        for n in names
    )
    program = tmp_path / "layout"
    source = f'#include <psabench.h>\n#include <stdio.h>\nint main(void){{{rows}printf("%d\\n", PSABENCH_ABI);}}'
    subprocess.run(
        ["cc", "-x", "c", "-", "-I", ROOT / "emu/api", "-o", program], input=source, text=True, check=True, timeout=60
    )
    *layout, abi = subprocess.run([program], capture_output=True, text=True, check=True, timeout=10).stdout.splitlines()
    fields = [getattr(clib.FrameStruct, n) for n in names]
    assert layout == [f"{f.offset} {f.size}" for f in fields]
    assert int(abi) == clib.ABI


@pytest.mark.parametrize("job", [clib.QuartzJobStruct, clib.FlightJobStruct])
def test_jobs_have_the_layout_of_the_header(job: type[ctypes.Structure], tmp_path: Path) -> None:
    names, struct = [str(row[0]) for row in job._fields_], str(job.__doc__).removesuffix(".")
    rows = "".join(f'printf("%zu\\n", offsetof({struct}, {n}));' for n in names)
    program = tmp_path / "layout"
    size = f'printf("%zu\\n", sizeof({struct}));'
    source = f"#include <psabench_models.h>\n#include <stdio.h>\nint main(void){{{rows}{size}}}"
    command = ["cc", "-x", "c", "-", "-I", str(ROOT / "emu/api"), "-o", str(program)]
    subprocess.run(command, input=source, text=True, check=True, timeout=60)
    layout = subprocess.run([program], capture_output=True, text=True, check=True, timeout=10).stdout.split()
    fields = [getattr(job, n).offset for n in names]
    assert [int(x) for x in layout] == [*fields, ctypes.sizeof(job)]


# ---- which library Python loads ----


def fake_library(path: Path, source: str) -> str:
    subprocess.run(["cc", "-shared", "-fPIC", "-x", "c", "-", "-o", path], input=source, text=True, check=True)
    return str(path)


def test_a_library_of_another_abi_is_refused(tmp_path: Path) -> None:
    path = fake_library(tmp_path / "other.so", "int psabench_abi(void) { return 99; }")
    with pytest.raises(BadInput, match=rf"^{path}: expected ABI 0 \(PSABENCH_LIB names another library\), got 99$"):
        clib.Library(path)


def test_a_library_that_lacks_a_function_is_refused(tmp_path: Path) -> None:
    path = fake_library(tmp_path / "old.so", "int psabench_abi(void) { return 0; } int psabench_version(void);")
    with pytest.raises(BadInput, match=r"expected a library of this version .*psabench_version"):
        clib.Library(path)


def test_the_environment_names_one_library_and_no_other(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PSABENCH_LIB", "/nowhere/libpsabench.so.0")
    monkeypatch.setattr(places, "CHECKOUT", tmp_path)  # nor is one there
    with pytest.raises(
        BadInput, match=r"expected a file at PSABENCH_LIB=/nowhere/libpsabench.so.0 \(make builds it\), got none"
    ):
        clib.library.__wrapped__()
    text = tmp_path / "text"
    text.write_text("not a library")
    monkeypatch.setenv("PSABENCH_LIB", str(text))
    with pytest.raises(BadInput, match=r"text: expected a shared library"):
        clib.library.__wrapped__()


# ---- an installation ----


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Staged under DESTDIR as a packager does, then looked at with pkg-config's sysroot."""
    stage = tmp_path_factory.mktemp("stage")
    run(["make", "--no-print-directory", "install", f"DESTDIR={stage}", "PREFIX=/opt/psa", "LIBDIR=/opt/psa/lib64"])
    return stage


def pkg_config(stage: Path, *options: str, package: str = "psabench") -> list[str]:
    out = run(
        ["pkg-config", *options, package],
        PKG_CONFIG_PATH=str(stage / "opt/psa/lib64/pkgconfig"),
        PKG_CONFIG_SYSROOT_DIR=str(stage),
    )
    return out.split()


@pytest.mark.parametrize("cc", ["gcc", "clang"])
@pytest.mark.parametrize("static", [False, True], ids=["shared", "static"])
@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_is_built_and_runs_against_the_installation(
    installed: Path, tmp_path: Path, cc: str, static: bool, example: str
) -> None:
    program = tmp_path / example
    options = pkg_config(installed, "--cflags", "--libs", *(["--static"] if static else []))
    link = ["-static"] if static else []
    run([cc, "-std=c11", *STRICT, ROOT / f"examples/{example}.c", *link, *options, "-o", program])
    out = run([program], LD_LIBRARY_PATH=str(installed / "opt/psa/lib64"))
    assert ("libpsabench" in run(["readelf", "-d", program])) is not static
    assert "V" in out
    shown = PAGE.read_text()
    assert out in shown, f"docs/library.md shows another output than\n{out}"


@pytest.mark.parametrize("cc", ["gcc", "clang"])
@pytest.mark.parametrize("static", [False, True], ids=["shared", "static"])
def test_north_is_found_by_a_c_program_against_the_installation(
    installed: Path, tmp_path: Path, cc: str, static: bool
) -> None:
    program = tmp_path / "find_north"
    options = pkg_config(installed, "--cflags", "--libs", *(["--static"] if static else []), package="psabench-nav")
    link = ["-static"] if static else []
    run([cc, "-std=c11", *STRICT, ROOT / "examples/find_north.c", *link, *options, "-o", program])
    out = run([program], LD_LIBRARY_PATH=str(installed / "opt/psa/lib64"))
    assert ("libpsabench-nav" in run(["readelf", "-d", program])) is not static
    assert out in (ROOT / "docs/nav.md").read_text()


@pytest.mark.parametrize("cc", ["gcc", "clang"])
def test_a_flight_is_navigated_by_a_c_program_against_the_installation(
    installed: Path, tmp_path: Path, cc: str
) -> None:
    program, flight = tmp_path / "navigate", tmp_path / "flight.txt"
    source = ROOT / "examples/koi/navigate.c"
    assert len(source.read_text().splitlines()) <= 100
    options = pkg_config(installed, "--cflags", "--libs", package="psabench-nav")
    run([cc, "-std=c11", *STRICT, source, *options, "-lm", "-o", program])
    run([sys.executable, ROOT / "examples/koi/record.py", flight])
    where = {"LD_LIBRARY_PATH": str(installed / "opt/psa/lib64")}
    assert run([program, flight], **where) in (ROOT / "docs/nav.md").read_text()
    flight.write_text("I 1 2\n")
    broken = subprocess.run([program, flight], env=os.environ | where, capture_output=True, text=True, check=False)
    assert (broken.returncode, broken.stderr) == (1, "navigate: line 1: expected I, F, H\n")


@pytest.mark.parametrize("part", parts())
def test_the_page_explains_every_counter(part: str) -> None:
    told = set(re.findall(r"`(\w+)`", PAGE.read_text().split("\n## Counters\n")[1].split("\n## ")[0]))
    with Bench() as bench:
        assert sorted(set(bench.part(part).counters) - told) == []


@pytest.mark.parametrize("cxx", ["g++", "clang++"])
def test_a_program_in_another_language_can_include_the_header(installed: Path, tmp_path: Path, cxx: str) -> None:
    source, program = tmp_path / "outside.cpp", tmp_path / "outside"
    source.write_text(
        "#include <nav/nav_mc.h>\n#include <nav/sins.h>\n#include <nav/strapdown.h>\n"
        "#include <psabench.h>\n#include <cstdio>\n"
        "int main()\n{\n    psabench *b = psabench_new(1);\n"
        '    psabench_part *p = psabench_part_new(b, "ads1255", "a", "start=at_once");\n'
        '    const int done = psabench_run_until_level(p, psabench_pin(p, "DRDY"), 0, 1000000000);\n'
        "    const int ordered = nav_kf_bytes() < nav_sins_bytes();\n"
        "    const int same = psabench_abi() == PSABENCH_ABI && nav_abi() == NAV_ABI && ordered;\n"
        '    std::printf("%d %d %d\\n", done, psabench_peek(p, ~0u), same);\n'
        "    psabench_free(b);\n}\n"
    )
    both = [
        *pkg_config(installed, "--cflags", "--libs"),
        *pkg_config(installed, "--cflags", "--libs", package="psabench-nav"),
    ]
    run([cxx, "-std=c++11", *STRICT, source, *both, "-o", program])
    assert run([program], LD_LIBRARY_PATH=str(installed / "opt/psa/lib64")) == "0 -1 1\n"


def test_uninstall_leaves_nothing_of_it(tmp_path: Path) -> None:
    where = [f"DESTDIR={tmp_path}", "PREFIX=/usr", "LIBDIR=/usr/lib/here"]
    run(["make", "--no-print-directory", "install", *where])
    ours = [p for folder in ("include", "lib") for p in (tmp_path / "usr" / folder).rglob("*") if not p.is_dir()]
    names = {str(p.relative_to(tmp_path)) for p in ours}
    lib = "usr/lib/here/"
    own = {"usr/include/psabench.h", "usr/include/psabench_models.h"}
    headers = own | {*(f"usr/include/psabench/nav/{p.name}" for p in (ROOT / "nav").glob("*.h"))}
    assert names == headers | {f"{lib}pkgconfig/{x}.pc" for x in ("psabench", "psabench-nav")} | {
        f"{lib}lib{x}"
        for name, abi in (("psabench", 0), ("psabench-nav", 1))
        for x in (f"{name}.a", f"{name}.so", f"{name}.so.{abi}")
    }
    assert "libdir=/usr/lib/here\n" in (tmp_path / f"{lib}pkgconfig/psabench.pc").read_text()
    run(["make", "--no-print-directory", "uninstall", *where])
    assert [p for p in tmp_path.rglob("*") if not p.is_dir()] == []


# ---- the page ----


def test_the_page_lists_parts_pins_and_options_as_the_library_does() -> None:
    so = ctypes.CDLL(str(ROOT / "build/libpsabench.so.0"))
    for name in ("parts", "options"):
        getattr(so, f"psabench_{name}").restype = ctypes.c_char_p
    page = PAGE.read_text()
    for part in so.psabench_parts().decode().split():
        section = re.search(rf"^### {part}\b.*?(?=^##|\Z)", page, re.MULTILINE | re.DOTALL)
        assert section is not None, part
        options = so.psabench_options(part.encode()).decode()
        assert f"```text\n{options}```" in section[0], f"{part}: the page has other options; these are\n{options}"


def test_the_picture_shows_the_recording_of_the_example(tmp_path: Path) -> None:
    program, vcd = tmp_path / "read", tmp_path / "run.vcd"
    library = ROOT / "build"
    source = ROOT / "examples/ads1256_read.c"
    run(["gcc", f"-I{ROOT / 'emu/api'}", source, f"-L{library}", "-lpsabench", "-o", program])
    run([program, vcd], LD_LIBRARY_PATH=str(library))
    svg = rdata_picture(read_vcd(vcd))
    shown = [e.text or "" for e in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]
    assert {"DRDY", "CS", "SCLK", "DIN", "DOUT", "01 RDATA"} <= set(shown)
    picture = ROOT / "docs/img/rdata.svg"
    if os.environ.get("GOLDEN") == "rewrite":
        picture.write_text(svg, encoding="utf-8")
    assert picture.read_text(encoding="utf-8") == svg


def test_the_page_lists_the_violations_of_every_part() -> None:
    page = (
        (ROOT / "docs/library.md").read_text().partition("| part | violations |\n|---|---|\n")[2].partition("\n\n")[0]
    )
    rows = [line.strip("| ").split(" | ") for line in page.splitlines()]
    listed = {part: re.findall(r"`(\w+)`", text) for names, text in rows for part in names.split(", ")}
    with Bench() as bench:
        assert listed == {part: list(bench.part(part).violations) for part in parts()}
