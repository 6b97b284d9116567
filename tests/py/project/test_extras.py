"""What pyproject.toml asks for is what the package imports; a command that lacks an extra says which one."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import metadata, util
from pathlib import Path

import pytest
from psabench import places
from psabench.cli import main
from psabench.errors import BadInput

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
MODULES = {"python-can": "can", "pyserial": "serial", "pyyaml": "yaml", "pyvisa-py": "pyvisa_py"} | places._MODULES
OURS_OR_THE_CALLERS = {"psabench", "pytest"}  # pytest loads its plugin
WITH_ANOTHER = {"traitlets": "IPython", "zstandard": "mcap"}  # what the other depends on
BASE_BYTES = 80e6  # the wheel adds 10 MB (test_wheel.py)


def name_of(requirement: str) -> str:
    m = re.match(r"[\w.-]+", requirement)
    assert m is not None
    return m[0].lower().replace("_", "-")


def modules_of(requirements: list[str]) -> set[str]:
    names = [name_of(r) for r in requirements]
    return {MODULES.get(n, n.replace("-", "_")) for n in names}


def imported(path: Path) -> Iterator[str]:
    """Top module of each import of a file, wherever it is."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]


def test_every_package_that_is_imported_is_a_dependency_or_in_an_extra() -> None:
    of_extras = [r for extra in PROJECT["optional-dependencies"].values() for r in extra]
    known = modules_of(PROJECT["dependencies"] + of_extras) | OURS_OR_THE_CALLERS | set(sys.stdlib_module_names)
    found = {
        f"{path.relative_to(ROOT)}: {module}"
        for path in (ROOT / "scripts/psabench").rglob("*.py")
        for module in imported(path)
        if WITH_ANOTHER.get(module, module) not in known
    }
    assert found == set()


def test_the_installation_knows_the_extras_of_the_project() -> None:
    named = {extra: modules_of(rs) for extra, rs in PROJECT["optional-dependencies"].items()}
    assert {(e, m) for e, ms in named.items() for m in ms} == set(places.extra_packages())


@pytest.mark.parametrize(
    ("words", "without", "extra"),
    [
        (["campaign", "gyrocompass"], "distributed", "campaigns"),
        (["run", "turns"], "matplotlib", "reports"),
        (["run", "gyrocompass"], "scipy", "reports"),
    ],
)
def test_a_command_names_the_extra_that_it_lacks(
    words: list[str], without: str, extra: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    find = util.find_spec
    monkeypatch.setattr(util, "find_spec", lambda name: None if name == without else find(name))
    assert main(words) == BadInput.exit_status
    printed = f"psabench: {words[0]}: expected the extra '{extra}', got none; pip install 'psabench[{extra}]'\n"
    assert capsys.readouterr().err == printed


def test_a_package_that_is_found_missing_later_is_named_by_its_extra() -> None:
    error = places.no_package(ModuleNotFoundError("", name="matplotlib.figure"), "view")
    assert str(error) == "view: expected the extra 'reports', got none; pip install 'psabench[reports]'"
    error = places.no_package(ModuleNotFoundError("", name="elsewhere"), "view")
    assert str(error) == "view: expected the Python package elsewhere, got none"


def test_without_extras_it_begins_small() -> None:
    """Size of the dependencies, and of what they depend on, as they are installed here."""
    waiting, sizes = list(PROJECT["dependencies"]), dict[str, int]()
    while waiting:
        name = name_of(waiting.pop())
        if name not in sizes:
            found = metadata.distribution(name)
            files = [Path(str(f.locate())) for f in found.files or ()]
            sizes[name] = sum(f.stat().st_size for f in files if f.suffix != ".pyc" and f.is_file())
            waiting += [r for r in found.requires or () if ";" not in r]
    assert not sizes.keys() & {"scipy", "matplotlib", "dask", "ipython", "pymavlink"}
    assert 10e6 < sum(sizes.values()) < BASE_BYTES, sizes
