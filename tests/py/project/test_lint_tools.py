"""The checks of tools/ find what they are for: each row is one breach in an otherwise clean tree."""

import importlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FUNCTION = "int f(void)\n{{\n{}}}\n"


def body(lines: int) -> str:
    """A function of so many lines, braces included."""
    return FUNCTION.format("    // .\n" * (lines - 2))


def check_includes(root: Path, files: dict[str, str]) -> subprocess.CompletedProcess[str]:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return subprocess.run(
        [sys.executable, ROOT / "tools/check_includes.py", root], capture_output=True, text=True, timeout=30
    )


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("emu/chip/a.c", '#include "base/reg.h"\n#include <stdint.h>\n'),
        ("emu/chip/ads1282/regs.c", '#include "chip/ads1282/filter.h"\n'),
        ("emu/chip/ads1282/regs.c", '#include "chip/ads1282/internal.h"\n'),
        ("emu/phys/lab.c", '#include "phys/motion/table.h"\n'),
        ("emu/scpi/a.c", '#include "control/control.h"\n'),
        ("emu/board/a.c", '#include "chip/ads1282/x.h"\n#include "gen/objects.h"\n'),
        ("emu/link/a.c", "#include <sys/socket.h>\n"),
        ("emu/app/a.c", '#include "link/link.h"\n'),
        ("emu/scenario/a.c", "#include <libfyaml.h>\n"),
        ("build/gen/a.c", '#include "a.h"\n#include "base/can/can.h"\n'),
        ("emu/base/a.c", body(40)),
        ("emu/base/a.c", (body(8) + "\n") * 3 + "// Long: one row per opcode.\n" + body(70)),
        ("emu/base/a.c", "//\n" * 600),
        ("emu/base/a.h", "//\n" * 150),
        ("emu/api/psabench.h", "//\n" * 250),
        ("emu/api/a.c", '#include "board/psa2/psa2.h"\n#include "trace/trace.h"\n'),
        (
            "nav/common/a.hpp",
            '#include "emu/base/detmath.h"\n#include "nav/nav.h"\n#include <Eigen/Dense>\n#include <cmath>\n',
        ),
        ("nav/north/a.cpp", '#include "nav/common/nav_math.hpp"\n#include "nav/north/b.hpp"\n'),
        ("nav/nav.h", "//\n" * 250),
    ],
)
def test_what_is_allowed_passes(tmp_path: Path, file: str, text: str) -> None:
    # Small functions beside it keep the median where it may be.
    done = check_includes(tmp_path, {file: text, "emu/base/z.c": body(3) * 3})
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("file", "text", "says"),
    [
        ("emu/base/a.c", '#include "trace/vcd.h"\n', "a.c:1: base may not include trace"),
        ("emu/chip/a.c", '\n#include "phys/sensor/mems.h"\n', "a.c:2: chip may not include phys"),
        ("emu/trace/a.h", '#include "chip/ads1282/ads1282.h"\n', "trace may not include chip"),
        ("emu/link/a.c", '#include "board/psa2/psa2.h"\n', "link may not include board"),
        ("emu/control/a.c", '#include "link/link.h"\n', "control may not include link"),
        ("emu/board/a.c", '#include "app/loop.h"\n', "board may not include app"),
        ("build/gen/a.c", '#include "board/psa2/psa2.h"\n', "gen may not include board"),
        ("emu/chip/ads1282/regs.c", '#include "chip/ads1256/ads1256.h"\n', "chip/ads1282 may not include chip/ads1256"),
        ("emu/base/a.c", "#include <time.h>\n", "operating system's header"),
        ("emu/board/a.c", "  #  include <unistd.h>\n", "operating system's header"),
        ("emu/board/a.c", "#include <libfyaml.h>\n", "belongs in scenario"),
        ("emu/board/psa2/a.c", '#include "board/psd1/psd1.h"\n', "board/psa2 may not include board/psd1"),
        ("emu/board/a.c", '#include "board/psd1/psd1.h"\n', "board may not include board/psd1"),
        ("emu/unit/a.c", '#include "board/psd1/internal.h"\n', 'internal.h" is for board/psd1 alone'),
        ("emu/control/a.c", '#include "scpi/scpi.h"\n', "control may not include scpi"),
        ("emu/base/a.c", '#include "reg.h"\n', "written from the include root"),
        ("emu/base/a.c", '#include "base/../chip/x.h"\n', "written from the include root"),
        ("emu/base/z.c", '#include <stdint.h>\n#include "base/z.h"\n', "first include must be the own header"),
        ("emu/shell/a.c", "", "not in the include table"),
        ("emu/base/a.c", body(41), "f() has 41 lines: say why"),
        ("emu/base/a.c", "// Long: no.\n" + body(71), "f() has 71 lines, at most 70"),
        ("emu/base/a.c", "// Long: of another one.\n" + body(3) + "\n" + body(41), "say why"),
        ("emu/base/a.c", "//\n" * 601, "601 lines, at most 600"),
        ("emu/base/a.h", "//\n" * 151, "151 lines, at most 150"),
        ("emu/api/psabench.h", "//\n" * 251, "251 lines, at most 250"),
        ("emu/api/a.h", "//\n" * 151, "151 lines, at most 150"),
        ("emu/api/a.c", "#include <unistd.h>\n", "operating system's header"),
        ("emu/api/a.c", '#include "app/loop.h"\n', "api may not include app"),
        ("nav/north/a.cpp", '#include "phys/sensor/mems.h"\n', "a.cpp:1: nav/north may not include phys"),
        ("nav/north/a.cpp", '#include "base/detmath.h"\n', "a.cpp:1: nav/north may not include base"),
        ("nav/north/a.cpp", '#include "emu/base/detmath.h"\n', "written from the include root"),
        ("nav/sins/a.cpp", '#include "nav/north/nav_fit.hpp"\n', "a.cpp:1: nav/sins may not include nav/north"),
        ("emu/phys/a.c", '#include "nav/nav.h"\n', "a.c:1: phys may not include nav"),
        ("nav/common/a.hpp", "#include <iostream>\n", "operating system's header"),
        ("emu/phys/a.c", "#include <Eigen/Dense>\n", "belongs in nav"),
        ("nav/north/a.hpp", "//\n" * 151, "151 lines, at most 150"),
        ("nav/north/a.cpp", body(41), "f() has 41 lines: say why"),
        ("emu/base/a.c", body(16) * 9, "the median function has 16 lines"),
    ],
)
def test_each_breach_is_named(tmp_path: Path, file: str, text: str, says: str) -> None:
    done = check_includes(tmp_path, {"emu/base/z.h": "", "emu/base/y.c": body(3) * 3, file: text})
    assert done.returncode == 1
    assert says in done.stdout


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize(
    ("folder", "text", "says"),
    [
        ("base", "int f(int x) { return x + 1; }", ""),
        ("base", "static const int t[] = {1, 2}; const int *f(int i) { return t + i; }", ""),
        ("base", 'static const char *const n[] = {"a"}; const char *f(int i) { return n[i]; }', ""),
        ("base", "#include <math.h>\ndouble f(double x) { return sqrt(floor(x)); }", ""),
        ("app", '#include <stdio.h>\nint n; void f(void) { printf("%d", n++); }', ""),
        ("control", "#include <stdlib.h>\nvoid *f(unsigned n) { return malloc(n); }", ""),
        ("base", "int count; int f(void) { return count++; }", "mutable global count"),
        ("base", "int f(void) { static int n = 3; return n++; }", "mutable global"),
        ("board", 'static const char *n[] = {"a"}; const char *f(int i) { return n[i]++; }', "mutable global n"),
        ("phys", "#include <math.h>\ndouble f(double x) { return sin(x); }", "calls sin()"),
        ("chip", "#include <stdlib.h>\nvoid *f(unsigned n) { return malloc(n); }", "calls malloc()"),
        ("trace", '#include <stdio.h>\nvoid f(int n) { printf("%d", n); }', "calls printf()"),
        ("board", "#include <time.h>\nlong f(void) { return (long)time(0); }", "calls time()"),
        ("board", "#include <stdlib.h>\nint f(void) { return rand(); }", "calls rand()"),
    ],
)
@pytest.mark.parametrize("cc", ["gcc", "clang"])
def test_symbols_of_the_core(tmp_path: Path, cc: str, folder: str, text: str, says: str) -> None:
    if shutil.which(cc) is None:
        pytest.skip(f"no {cc}")
    source, objects = tmp_path / "a.c", tmp_path / "obj/emu" / folder
    source.write_text(text + "\n")
    objects.mkdir(parents=True)
    subprocess.run([cc, "-O2", "-c", "-o", objects / "a.o", source], check=True)
    done = subprocess.run(
        [sys.executable, ROOT / "tools/check_symbols.py", tmp_path / "obj"], capture_output=True, text=True, timeout=30
    )
    assert (done.returncode, says in done.stdout) == (1 if says else 0, True), done.stdout


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_circles_of_symbols_are_found(tmp_path: Path) -> None:
    texts = {
        "a/x": "int y(void); int x(void) { return y(); }",
        "b/y": "int z(void); int y(void) { return z(); }",
        "a/z": "int w(void); int z(void) { return w(); }",
        "c/w": "int w(void) { return 1; }",
        "c/p": "int q(void); int p(int n) { return n ? q() : 0; }",
        "c/q": "int p(int n); int q(void) { return p(0); }",
    }
    for name, text in texts.items():
        path = tmp_path / "emu" / f"{name}.o"
        path.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["gcc", "-x", "c", "-c", "-o", path, "-"], input=text, text=True, check=True, timeout=30)
    sys.path.insert(0, str(ROOT / "tools"))
    check_symbols = importlib.import_module("check_symbols")
    objects = sorted(tmp_path.rglob("*.o"))
    found = check_symbols.circle_breaches(tmp_path, objects, limits=(0, 0))
    assert found == ["circle: a, b", "circle: c/p, c/q"]
    assert check_symbols.circle_breaches(tmp_path, objects, limits=(1, 0)) == found[1:]
    assert check_symbols.circle_breaches(tmp_path, objects, limits=(1, 1)) == []


# ---- the shape of the project

SHAPE = {
    "scripts/psabench/__init__.py": "",
    "scripts/psabench/a.py": "from psabench.b import f\n",
    "scripts/psabench/b.py": "def read_b():\n    return 0x00FF\n\n\nf = read_b\n",
    "scripts/psabench/boards/pmka/__init__.py": "NAME = 'pmka'\n",
    "emu/a.c": "\n",
}


def check_shape(root: Path, files: dict[str, str]) -> subprocess.CompletedProcess[str]:
    for name, text in (SHAPE | files).items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    command = [sys.executable, str(ROOT / "tools/check_shape.py"), "--root", str(root)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, env={"GIT_CEILING_DIRECTORIES": "/"})


def test_a_small_project_has_its_shape(tmp_path: Path) -> None:
    done = check_shape(tmp_path, {})
    assert (done.returncode, done.stderr) == (0, "")
    assert "shape: import-circles 0 (limit 0)" in done.stdout
    assert "shape: tracked-files 5 (limit " in done.stdout


@pytest.mark.parametrize(
    ("files", "says"),
    [
        (
            {"b.py": "import psabench.a\nf = 0\n"},
            "import-circles: expected at most 0, got 1\n  psabench.a <-> psabench.b",
        ),
        ({"b.py": "def f():\n    from psabench import a\n    return a\n"}, "import-circles: expected at most 0, got 1"),
        (
            {"b.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from psabench.a import f\n"},
            "import-circles: expected at most 0, got 1",
        ),
        ({"b.py": "f = (0x2030, 0x1018, 0x00FF)\n"}, "object-numbers: expected at most 0, got 2\n"),
        ({f"m{k}.py": "" for k in range(14)}, "loose-modules: expected at most 14, got 16"),
        ({f"{k}/m.py": "# PMKA\n" for k in range(4)}, "modules-that-name-pmka: expected at most 3, got 4"),
        ({f"{d}/m{k}.py": "" for k in range(31) for d in ("link", "shell")}, "link: 31 files"),
    ],
)
def test_a_breach_of_the_shape_is_reported(tmp_path: Path, files: dict[str, str], says: str) -> None:
    done = check_shape(tmp_path, {f"scripts/psabench/{name}": text for name, text in files.items()})
    assert done.returncode == 1
    assert says in done.stderr


def test_what_a_metric_counts_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    shape = importlib.import_module("check_shape")
    assert shape.main(["--list", "loose-modules"]) == 0
    assert "cli.py" in capsys.readouterr().out.splitlines()
    assert shape.main(["--list", "nothing"]) == 2
    assert capsys.readouterr().err.startswith("--list: expected import-circles, ")
