"""A series holds the runs of one build: those of others are reported, kept, forgotten, and never mixed in."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from command_line import QUIET
from psabench.campaign import builds, chains, command, runner, workers
from psabench.campaign.cases import STUDIES
from psabench.campaign.command import Options
from psabench.campaign.runner import Plan
from psabench.campaign.setup import Setup
from psabench.campaign.store import Store
from psabench.errors import BadInput, BenchError
from psabench.native.navlib import NAME, library
from psabench.places import PACKAGE, proto_file

(R0,) = [c for c in STUDIES["readings"].cases(Setup()) if c.name == "R0"]


def another_build(monkeypatch: pytest.MonkeyPatch, build: str = "0123456789abcdef") -> None:
    """As if the library had been built again."""
    monkeypatch.setattr(chains.Chain, "build", lambda _: build)


def test_results_of_another_build_are_told_kept_and_never_mixed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few, more = (Options(case="R0", chain="samples", runs=n, workers=1, out=tmp_path) for n in (8192, 9000))
    mine = builds.algebra()[:12]
    command.campaign(few, QUIET)
    assert capsys.readouterr().err == ""
    another_build(monkeypatch)
    command.campaign(more, QUIET)
    err = capsys.readouterr().err
    told = f"psabench: {tmp_path}/store.sqlite: runs of other builds than 0123456789ab"
    assert f"{told} (8192 by {mine}) are kept, not used; --forget-others removes them\n" in err
    p = Plan(cases=[R0], chain="samples", runs=9000, seed=1)
    with Store(tmp_path / "store.sqlite") as store:
        assert store.runs(p.origin(R0)) == {0: 8192, 8192: 808}  # all of them, not the rest alone
        assert store.others(p.origin(R0)) == {builds.algebra(): 8192}
    command.campaign(replace(more, forget_others=True), QUIET)
    assert f"{told} (8192 by {mine}) are removed\n" in capsys.readouterr().err
    command.campaign(more, QUIET)
    assert capsys.readouterr().err == ""
    monkeypatch.undo()  # the first build is back: it finds nothing of its own
    command.campaign(few, QUIET)
    assert "(9000 by 0123456789ab) are kept" in capsys.readouterr().err


class Elsewhere:
    """A worker whose library was built again after the campaign had started."""

    count = 1

    def map(self, compute: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        for task in tasks:
            yield [replace(p, origin=replace(p.origin, build="0123456789abcdef")) for p in compute(task)]


def test_a_worker_whose_build_changed_on_the_way_ends_it(tmp_path: Path) -> None:
    with Store(tmp_path / "s") as store:
        wanted = runner.missing(Plan(cases=[R0], chain="closed", runs=10, seed=1), store)
        with pytest.raises(BenchError, match="psabench was rebuilt during the run"):
            runner.run(wanted, store, Elsewhere(), QUIET)
        assert store.origins() == []


class Cluster:
    """A Dask client whose workers say this of themselves."""

    def __init__(self, *told: str) -> None:
        self._told = told

    def wait_for_workers(self, _: int, *, timeout: float) -> None:
        assert timeout > 0

    def run(self, own: Callable[[], str]) -> dict[str, str]:
        assert own() == workers.own_build("emulated")
        return {f"tcp://{k}": told for k, told in enumerate(self._told)}


def test_a_cluster_with_another_build_is_refused() -> None:
    own = partial(workers.own_build, "emulated")
    mine = own()
    assert mine.endswith(f"build {builds.wire()[:12]}")
    workers._same_psabench(Cluster(mine, mine), "tcp://there", own)
    with pytest.raises(BadInput, match=r"--dask tcp://there: expected workers with psabench .*, got mine, build 0123"):
        workers._same_psabench(Cluster(mine, "mine, build 0123"), "tcp://there", own)


def test_a_build_is_what_its_files_hold(tmp_path: Path) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    a.write_bytes(b"one")
    b.write_bytes(b"two")
    first = builds.digest([a, b])
    assert builds.digest([b, a]) != first
    assert builds.digest([a]) != first
    assert builds.algebra() == hashlib.sha256(Path(library().path).read_bytes()).hexdigest()
    a.rename(tmp_path / "c")
    assert builds.digest([tmp_path / "c", b]) == first
    b.write_bytes(b"twO")
    assert builds.digest([tmp_path / "c", b]) != first


def made_package(root: Path) -> Path:
    """A package with what the emulated chain would import, and more; its modules by name."""
    files = {
        "__init__": "",
        "campaign/__init__": "",
        "campaign/chains": "import json\nfrom psabench.nav import alpha\n\ndef f():\n    from psabench import bench\n",
        "nav": "import psabench.deep.inner as i\nalpha = 1\n",
        "bench": "from psabench.campaign import chains\n",  # a ring
        "deep/__init__": "import psabench.errors\n",
        "deep/inner": "",
        "deep/beside": "",
        "errors": "",
        "conform/__init__": "from psabench.nav import alpha\n",
        "conform/suite": "import psabench.campaign.chains\n",
    }
    for name, text in files.items():
        path = root / "psabench" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root / "psabench"


def test_the_sources_of_a_module_are_what_it_imports_at_any_depth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = made_package(tmp_path)
    monkeypatch.setattr(builds, "PACKAGE", package)
    found = [str(path.relative_to(package)) for path in builds.sources("psabench.campaign.chains")]
    chain = ["campaign/__init__", "campaign/chains", "deep/__init__", "deep/inner", "errors", "nav"]
    assert found == [f"{name}.py" for name in ("__init__", "bench", *chain)]


def test_what_goes_through_the_wire_is_built_of_emulator_library_protocol_and_host(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The build is another one when any of them is, and the same when something else is; asked without its cache."""
    wire = builds.wire.__wrapped__
    for name in ("find_emulator", "_loaded"):
        (tmp_path / name).write_bytes(b"one")
        monkeypatch.setattr(builds, name, lambda name=name: tmp_path / name)
    for name in builds.WIRE_PROTO:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"one")
    monkeypatch.setattr(builds, "proto_file", lambda name: tmp_path / name)
    package = made_package(tmp_path)
    monkeypatch.setattr(builds, "PACKAGE", package)
    found = [wire()]
    parts = ["find_emulator", "_loaded", *builds.WIRE_PROTO, "psabench/bench.py", "psabench/campaign/chains.py"]
    for name in parts:
        (tmp_path / name).write_bytes((tmp_path / name).read_bytes() + b"\n#")
        found.append(wire())
    assert len(set(found)) == 1 + len(parts)
    for name in ("conform/__init__.py", "conform/suite.py", "deep/beside.py"):
        (package / name).write_text("other = True\n")
    assert wire() == found[-1]


READ_BY_A_RUN = """
import sys

opened = set()
sys.addaudithook(lambda event, args: opened.add(str(args[0])) if event == "open" else None)
from psabench.campaign.cases import STUDIES
from psabench.campaign.chains import Wanted, compute
from psabench.campaign.setup import Setup

setup = next(c.setup for c in STUDIES["wire"].cases(Setup()) if c.name == "article")
(part,) = compute([Wanted(chain=sys.argv[1], setup=setup, hold=None, seed=1, first_run=0, runs=1)])
assert part.rows[0, 1] == part.rows[0, 1]
modules = {m.__file__ for name, m in sys.modules.items() if name.partition(".")[0] == "psabench"}
print("\\n".join(opened | modules))
"""


@pytest.mark.host
@pytest.mark.parametrize("chain", ["emulated", "wire"])
def test_whatever_a_run_reads_is_in_its_build(chain: str) -> None:
    """Of ours: modules that it has loaded, files that it has opened. The studies are in the key, as their set-ups."""
    done = subprocess.run(
        [sys.executable, "-c", READ_BY_A_RUN, chain], capture_output=True, text=True, check=True, timeout=120
    )
    read = {Path(line).resolve() for line in done.stdout.splitlines()}
    proto = proto_file("psabench.dbc").resolve().parent
    known = {*builds.sources(builds.WIRE_MODULE), *(proto_file(name).resolve() for name in builds.WIRE_PROTO)}
    ours = {p for p in read if (p.suffix == ".py" and p.is_relative_to(PACKAGE)) or p.is_relative_to(proto)}
    assert ours - known == {PACKAGE / "campaign" / "cases.py"}
    assert len(ours & known) > 40
    assert not any(p.is_relative_to(PACKAGE / "conform") for p in known)


def test_a_library_that_the_loader_found_is_found_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its path is a bare name then; the kernel knows the file."""
    file = Path(library().path).resolve()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(library(), "path", NAME)
    assert builds._loaded().resolve() == file
