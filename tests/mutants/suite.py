"""The device suite, run on an emulator that somebody has built: what became of each requirement."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from psabench.emulator import STOP_S

from tests.mutants.declared import Target
from tests.mutants.tree import ROOT, SUITE, copy

PROGRAM = "import sys; from psabench.cli import main; sys.exit(main())"
NO_VERDICT = {3: "crashed"}  # exit status of psabench without a verdict: the bench or a link failed
REFUSED = "psabench: psa-emu: "  # begins what it says of an emulator that rejects its bench
BADNESS = {"failed": 2, "inconclusive": 1}  # of a verdict; the others: 0
GRACE_S = 6 * STOP_S  # psabench ends its emulator, which has a session of its own, by force after STOP_S
NO_DEBUGGER = {"PYTHONFAULTHANDLER": "", "NO_COLOR": "1"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What one run came to. verdicts: by requirement; empty where there is none."""

    how: str  # judged, crashed or refused (the emulator), time-out, broken (the suite)
    verdicts: Mapping[str, str] = field(default_factory=dict)
    tests: Mapping[str, str] = field(default_factory=dict)
    conforms: bool = False
    said: str = ""
    took_s: float = 0.0

    def worse_than(self, before: Run) -> list[str]:
        """Requirements whose verdict is worse than before, the failed ones first."""
        found = [i for i, v in self.verdicts.items() if _badness(v) > _badness(before.verdicts.get(i, ""))]
        return sorted(found, key=lambda i: (-_badness(self.verdicts[i]), i))


def _badness(verdict: str) -> int:
    return BADNESS.get(verdict, 0)


class Suite:
    """A copy of the suite as it is now: who edits it meanwhile changes nothing here."""

    def __init__(self, folder: Path, root: Path = ROOT) -> None:
        self._folder = folder
        self._here = folder / "suite"
        self._child: subprocess.Popen[bytes] | None = None
        self._stopped = False
        if not self._here.is_dir():
            copy(SUITE, root, self._here)

    def beside(self, folder: Path) -> Suite:
        """The same suite once more, for another thread: what it runs writes into another folder."""
        shutil.copytree(self._here, folder / "suite")
        return Suite(folder)

    def stop(self) -> None:
        """From another thread: what runs is ended, nothing is begun any more."""
        self._stopped = True
        if self._child is not None:
            end_group(self._child)

    def run(self, emulator: Path, target: Target, timeout_s: float, only: Sequence[str] = ()) -> Run:
        """Judge this emulator. only: requirements; empty: all."""
        out = self._folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        words = ["conform", "device", "--board", target.board, "--out", str(out), "--min-judged", "1"]
        words += ["--profile", target.profile] if target.profile else []
        words += ["--adapter", target.adapter] if target.adapter else []
        words += ["--only", *only] if only else []
        begun_s = time.monotonic()
        status, said = self._bounded([sys.executable, "-c", PROGRAM, *words], self._env(emulator), out, timeout_s)
        took_s = time.monotonic() - begun_s
        path = out / "conform.json"
        if status is None:
            return Run(how="time-out", said=f"no end after {timeout_s:.0f} s", took_s=took_s)
        if not path.is_file():
            how = "refused" if said.startswith(REFUSED) else NO_VERDICT.get(status, "broken")
            return Run(how=how, said=said, took_s=took_s)
        found = json.loads(path.read_text(encoding="utf-8"))
        return Run(
            how="judged",
            verdicts=found["requirements"],
            tests={t["test"]: t["verdict"] for t in found["tests"]},
            conforms=status == 0,
            said=said,
            took_s=took_s,
        )

    def _env(self, emulator: Path) -> dict[str, str]:
        env = {k: v for k, v in os.environ.items() if not k.startswith("PSABENCH_")}
        return env | {"PSA_EMU": str(emulator), "PYTHONPATH": str(self._here / "scripts"), **NO_DEBUGGER}

    def python(self, emulator: Path, words: list[str], timeout_s: float) -> tuple[int | None, str]:
        """A program of ours beside this suite's modules: exit status (None: time-out) and the end of what it said."""
        env = self._env(emulator)
        env["PYTHONPATH"] = os.pathsep.join([env["PYTHONPATH"], str(ROOT), str(ROOT / "tools")])
        scratch = self._folder / "scratch"
        scratch.mkdir(exist_ok=True)
        return self._bounded([sys.executable, *words], env, scratch, timeout_s)

    def _bounded(self, command: list[str], env: dict[str, str], cwd: Path, timeout_s: float) -> tuple[int | None, str]:
        """Exit status, None after a time-out, and the last lines; whatever it started is ended with it."""
        log = cwd / "said"
        with log.open("w", encoding="utf-8") as to:
            child = subprocess.Popen(command, cwd=cwd, env=env, stdout=to, stderr=to, start_new_session=True)
            self._child = child
            status: int | None = None
            try:
                status = child.wait(0 if self._stopped else timeout_s)
            except subprocess.TimeoutExpired:
                pass
            finally:
                end_group(child)
                self._child = None
        return status, "\n".join(log.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-12:])


def end_group(child: subprocess.Popen[bytes]) -> None:
    """It and its group: first as Ctrl-C would, which lets it close its emulator."""
    for sign, timeout_s in ((signal.SIGINT, GRACE_S), (signal.SIGKILL, GRACE_S)):
        if child.poll() is not None:
            break
        os.killpg(child.pid, sign)
        try:
            child.wait(timeout_s)
        except subprocess.TimeoutExpired:
            continue
    try:
        os.killpg(child.pid, signal.SIGKILL)
    except ProcessLookupError:
        return
