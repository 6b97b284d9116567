"""Start and stop the emulator, and learn where its endpoints are.

The emulator prints one `ready key=value ...` line per endpoint and `ready all` at the end; ports are chosen by the
kernel (`socketcand:0`), so any number of emulators run side by side.
"""

from __future__ import annotations

import json
import os
import re
import selectors
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, BenchError, StartError
from psabench.link.control import Control
from psabench.places import executable, find_emulator, own_emulators
from psabench.report import provenance

READY = re.compile(r'(?P<key>\w+)=(?P<value>"(?:[^"\\]|\\.)*"|\S*)')  # of a ready line
START_S = 20.0  # timeout for "ready all": a bare emulator needs milliseconds, one under sanitizers in a guest seconds
STOP_S = 10.0


class Emulator:
    """A running psa-emu: `with Emulator(["quiet.yaml"], cans=["socketcand:0"], pace="step") as emu: ...`.

    `endpoints` holds one dict per `ready` line, e.g. {"can": "socketcand", "host": "127.0.0.1", "port": "40123"}.
    """

    def __init__(
        self,
        scenario: str | Path | None = None,
        *,
        cans: Sequence[str] = ("socketcand:0",),
        pace: str = "step",
        seed: int | None = None,
        control: bool = True,
        truth: bool = False,
        scpi: bool = False,
        extra: Sequence[str | Path] = (),
    ) -> None:
        self._dir = tempfile.TemporaryDirectory(prefix="psabench-")
        self.directory = Path(self._dir.name)
        self._scenario = str(scenario or "")
        self.control_path = self.directory / "control" if control else None
        self.truth_path = self.directory / "truth" if truth else None
        self.argv = [str(find_emulator()), *([str(scenario)] if scenario else []), "--pace", pace, "--until-eof"]
        for can in cans:
            self.argv += ["--can", can]
        paths = {"--control": self.control_path, "--truth": self.truth_path}
        for option, value in {"--seed": seed, **paths, "--scpi": "all:0" if scpi else None}.items():
            self.argv += [] if value is None else [option, str(value)]
        self.argv += [str(x) for x in extra]
        if "--resolved" not in self.argv and provenance.noted_run():
            self.argv += ["--resolved", str(self.directory / "scenario.json")]
        self.endpoints: list[dict[str, str]] = []
        self._stderr = (self.directory / "stderr").open("w+b")
        self._messages = ""
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Emulator:
        self._process = subprocess.Popen(
            self.argv,
            stdin=subprocess.PIPE,  # never written: its end is ours, however that comes
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            start_new_session=True,  # a Ctrl-C meant for the procedure must not kill the bench under it
        )
        try:
            self._read_ready()
            self._note_run()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    @property
    def status(self) -> int | None:
        """Exit status of an emulator that has ended by itself; None: it runs."""
        assert self._process is not None
        return self._process.poll()

    def signal(self, number: int) -> None:
        """Send it a signal, if it still runs."""
        assert self._process is not None
        self._process.send_signal(number)

    def endpoint(self, **wanted: str) -> dict[str, str]:
        """The first endpoint with these values, e.g. endpoint(can="slcan"). Raises BenchError if there is none."""
        for e in self.endpoints:
            if all(e.get(k) == v for k, v in wanted.items()):
                return e
        raise BenchError(f"emulator has no endpoint {wanted}; it has {self.endpoints}")

    def messages(self) -> str:
        """What the emulator has written to stderr so far, or, after stop(), in all."""
        if not self._stderr.closed:
            self._messages = (self.directory / "stderr").read_text(errors="replace")
        return self._messages

    def wait(self, timeout_s: float) -> int:
        """Exit status of an emulator that ends by itself (`--for`). Raises BenchError when it does not."""
        assert self._process is not None
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise BenchError(f"emulator still runs after {timeout_s:g} s: {' '.join(self.argv)}") from None

    def stop(self) -> int:
        """Ends it with SIGTERM (it closes its files), by force if it hangs; returns the exit status."""
        status = -1
        if self._process is not None:
            if self._process.poll() is None:
                self._process.send_signal(signal.SIGTERM)
            try:
                status = self._process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                status = self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe:
                    pipe.close()
        self.messages()  # before they are gone
        self._stderr.close()
        self._dir.cleanup()
        return status

    def _note_run(self) -> None:
        """For the provenance of a report."""
        if provenance.noted_run():
            provenance.note_program("psa-emu", Path(self.argv[0]))
            name = self._value_of("--restore") or self._scenario or "calibrate"
            provenance.note_scenario(name, Path(self._value_of("--resolved")).read_text(encoding="utf-8"))

    def _value_of(self, option: str) -> str:
        """Of an option of the emulator's; "": it is not given."""
        return self.argv[self.argv.index(option) + 1] if option in self.argv else ""

    def _read_ready(self) -> None:
        assert self._process is not None
        assert self._process.stdout is not None
        deadline = time.monotonic() + START_S
        text = b""
        fd = self._process.stdout.fileno()
        with selectors.DefaultSelector() as ready:
            ready.register(fd, selectors.EVENT_READ)
            while b"ready all\n" not in text:
                if not ready.select(max(0.0, deadline - time.monotonic())):
                    raise BenchError(f"emulator not ready after {START_S:g} s: {' '.join(self.argv)}")
                chunk = os.read(fd, 4096)
                if not chunk:
                    bad_input = self._process.wait() == BadInput.exit_status
                    words = self.messages().strip() or f"emulator ended: {' '.join(self.argv)}"
                    raise BadInput(words) if bad_input else StartError(words)
                text += chunk
        for line in text.decode().splitlines():
            if line.startswith("ready ") and line != "ready all":
                self.endpoints.append(dict(_key_value(m) for m in READY.finditer(line)))


def read_resolved(path: Path) -> dict[str, Any]:
    """What `psa-emu --resolved` wrote: the scenario with every key, and the seed."""
    scenario: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return scenario


def _key_value(m: re.Match[str]) -> tuple[str, str]:
    """A value with a space in it is a string of JSON."""
    value = m["value"]
    return m["key"], json.loads(value) if value.startswith('"') else value


class Forked:
    """A copy of a running emulator, made by its `fork` command: a process of its own, with doors of its own."""

    def __init__(self, parent: Control, *, can: str = "socketcand:0", seed: int | None = None) -> None:
        self._dir = tempfile.TemporaryDirectory(prefix="psabench-")
        self.directory = Path(self._dir.name)
        self.control_path = self.directory / "control"
        self.truth_path = self.directory / "truth"
        try:
            paths = {"control": str(self.control_path), "truth": str(self.truth_path)}
            made = parent.call("fork", can=can, **paths, **({} if seed is None else {"seed": seed}))
        except BaseException:
            self._dir.cleanup()
            raise
        self.pid = int(made.result["pid"])
        self.endpoints: list[dict[str, str]] = [{k: str(v) for k, v in e.items()} for e in made.result["endpoints"]]

    def stop(self) -> int:
        """Ends it with `quit`; 0, or -1 when it had gone."""
        try:
            with Control(self.control_path) as control:
                control.call("quit")
        except BenchError:
            return -1
        finally:
            self._dir.cleanup()
        return 0


def main() -> int:
    """The command psa-emu of an installed package: becomes the emulator of the bundle or the checkout."""
    for path in own_emulators():
        if executable(path):
            os.execv(path, ["psa-emu", *sys.argv[1:]])
    print(f"psa-emu: not found at {' or '.join(map(str, own_emulators()))}; `make` builds it", file=sys.stderr)
    return BadInput.exit_status
