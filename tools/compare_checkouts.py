#!/usr/bin/env python3
"""Whether two built checkouts behave alike: `tools/compare_checkouts.py OLD NEW [--conform] [--only WORD]`.

Runs the emulator of each on every scenario and on a unit of every profile, and compares what comes out, byte by byte:

  bus     frames and their instants, as `--can log` records them
  lines   edges, the VCD of the first unit
  truth   the true state, every 10 ms
  keys    the scenario with every key, `--dump`
  objects  answers to SDO requests for every index of INDICES, and to writes of them, in step pace
  state   the digest of the bench in a snapshot, taken in step pace after commands and faults
  old     NEW restores a snapshot of OLD, and has the same bus and the same digest after it

and the names of commands, SCPI headers, faults, keys and profiles (`--list-*`): each of OLD must be there in NEW.
--conform: verdicts of the conformance suite by requirement id, with each checkout's own suite on its own emulator.
Exit status: 0 alike, 1 something differs, 2 bad input.
"""

import argparse
import json
import re
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

BOARDS = {  # profiles by the board that they begin with; all others are PSA-2's
    "psd1": "psd1",
    "pmka": "pmka",
    "pik": "pik",
    "gyro": "gyro",
}
CONFORM = "psa2:article psa2:lab32 psa1:psa1 psd1:psd1 psd1:psd1_host pmka:pmka pik:pik pik5:pik5 pik6:pik6 gyro:gyro"
SIM_S = 2.0  # of each run in free pace
STEPS: list[
    tuple[str, dict[str, Any]]
] = [  # what a snapshot has behind it; a command that a bench rejects changes nothing
    ("run", {"for_s": 0.2}),
    ("head.turn", {"angle_deg": 30}),
    ("table.rate", {"axis": 1, "rate_dps": 5}),
    ("chamber.set", {"temp_degc": 40}),
    ("supply.ripple", {"amplitude_v": 0.1, "frequency_hz": 100}),
    ("run", {"for_s": 0.2}),
    ("can.put", {"frame": "000#0100"}),
    ("unit.reset", {}),
    ("run", {"for_s": 0.3}),
]
INDICES = [*range(0x1000, 0x1030), 0x1200, 0x1400, 0x1800, 0x1801, 0x1A00, 0x1A01, *range(0x2000, 0x2180)]
SUBS = (0, 1)
FAULT_ARGS = {  # a value for each argument that a kind may need
    "out_v": 1.0, "bias_v": 0.1, "drift_v_per_s": 0.1, "scale_ppm": 500, "rms_v": 1e-3, "low_v": -1, "high_v": 1,
    "reference_ppm": 100, "drift_ppm_per_s": 10, "amplitude_v": 0.01, "frequency_hz": 10, "level": "low", "register": 1,
    "mask": 1, "clock_ppm": 100, "width_ns": 100, "pulse": 3, "rate_hz": 100, "probability": 0.5, "frames": 5,
    "hold_s": 0.01, "for_s": 0.01, "drop_v": 3, "drift_degph": 1, "count": 1,
}  # fmt: skip


@dataclass(slots=True)
class Outcome:
    """How many things were compared, and which differ."""

    compared: int = 0
    different: list[str] = field(default_factory=list)

    def equal(self, what: str, old: object, new: object) -> None:
        self.compared += 1
        if old != new:
            self.different.append(what)
            print(f"DIFFERENT {what}", flush=True)


class Bench:
    """An emulator in step pace with its control socket."""

    def __init__(self, root: Path, folder: Path, *options: str) -> None:
        self.path = folder / "control"
        self.process = subprocess.Popen(
            [root / "build/psa-emu", "--quiet", "--pace", "step", "--control", self.path, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=root,
        )
        assert self.process.stdout
        for line in self.process.stdout:
            if line.startswith("ready all"):
                break
        else:
            raise RuntimeError(f"{root}: {self.process.communicate()[1]}")
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(self.path))
        self.lines = self.socket.makefile("rw")

    def run(self, for_s: float) -> None:
        answer = self.say("run", for_s=for_s)
        assert answer["ok"], answer

    def say(self, cmd: str, **args: Any) -> dict[str, Any]:
        self.lines.write(json.dumps({"id": 1, "cmd": cmd, "args": args}) + "\n")
        self.lines.flush()
        while "ok" not in (answer := json.loads(self.lines.readline())):
            pass
        found: dict[str, Any] = answer
        return found

    def end(self) -> None:
        self.say("quit")
        self.socket.close()
        self.process.wait(30)
        self.process.communicate()


def scenarios(root: Path, folder: Path) -> Iterator[tuple[str, str]]:
    """Name and argument: each scenario of the checkout, and a unit of each profile."""
    for path in sorted((root / "proto/scenarios").glob("*.yaml")):
        yield path.stem, path.stem
    for path in sorted((root / "proto/profiles").glob("*.yaml")):
        board = next((b for start, b in BOARDS.items() if path.stem.startswith(start)), "psa2")
        if board == "gyro":
            continue  # needs a platform: the scenarios of the gyrocompass have it
        file = folder / f"profile_{path.stem}.yaml"
        file.write_text(f"seed: 7\nunits:\n  - {{name: a, board: {board}, profile: {path.stem}}}\n")
        yield f"profile {path.stem}", str(file)


def free_run(root: Path, folder: Path, scenario: str) -> dict[str, bytes]:
    out = {name: folder / name for name in ("bus", "lines", "truth")}
    options = ["--quiet", "--pace", "free", "--start", "--for", f"{SIM_S}s", "--can", f"log:{out['bus']}"]
    options += ["--vcd", str(out["lines"]), "--truth-log", str(out["truth"]), scenario]
    subprocess.run([root / "build/psa-emu", *options], check=True, capture_output=True, cwd=root)
    dump = subprocess.run(
        [root / "build/psa-emu", "--dump", scenario], check=True, capture_output=True, cwd=root
    ).stdout
    return {name: path.read_bytes() for name, path in out.items()} | {"keys": dump}


def ask_objects(bench: Bench) -> None:
    """SDO uploads, and a download of 1 byte, of each index, to the first unit."""
    node = bench.say("units")["result"]["units"][0]["node"]
    for index in INDICES:
        for sub in SUBS:
            address = f"{index & 0xFF:02X}{index >> 8:02X}{sub:02X}"
            bench.say("can.put", frame=f"{0x600 + node:03X}#40{address}00000000")
            bench.run(0.001)
            bench.say("can.put", frame=f"{0x600 + node:03X}#2F{address}01000000")
            bench.run(0.001)


def add_faults(bench: Bench) -> int:
    """Every kind at its first point, one after the other, each lifted after 10 ms. How many were taken."""
    taken = 0
    for kind in bench.say("fault.kinds")["result"]["kinds"]:
        points = bench.say("fault.points", kind=kind["kind"]).get("result", {}).get("points", [])
        args = {a["name"]: FAULT_ARGS[a["name"]] for a in kind["args"] if not a["optional"]}
        for point in points[:1]:
            taken += bench.say("fault.add", kind=kind["kind"], point=point, **{"for_s": 0.01, **args})["ok"]
            bench.run(0.02)
    return taken


def digest_of(snapshot: Path) -> str:
    states = [json.loads(line).get("state") for line in snapshot.read_text().splitlines()]
    return str(next(s for s in states if s))


def stepped(root: Path, folder: Path, scenario: str) -> tuple[str, int, bytes, Path]:
    bench = Bench(root, folder, "--start", "--can", f"log:{folder / 'bus'}", scenario)
    for cmd, args in STEPS:
        if cmd == "run":
            bench.run(**args)
        else:
            bench.say(cmd, **args)
    ask_objects(bench)
    faults = add_faults(bench)
    path = folder / "snapshot"
    bench.say("snapshot", path=str(path))
    bench.end()
    return digest_of(path), faults, (folder / "bus").read_bytes(), path


def restored(root: Path, folder: Path, snapshot: Path) -> tuple[str, bytes]:
    try:
        bench = Bench(root, folder, "--restore", str(snapshot), "--can", f"log:{folder / 'bus'}")
    except RuntimeError as e:
        return str(e), b""
    bench.run(0.5)
    again = folder / "again"
    bench.say("snapshot", path=str(again))
    bench.end()
    return digest_of(again), (folder / "bus").read_bytes()


def names(root: Path, listing: str) -> set[str]:
    """First cells of the tables that a listing prints."""
    text = subprocess.run(
        [root / "build/psa-emu", listing], check=True, capture_output=True, text=True, cwd=root
    ).stdout
    rows = re.findall(r"^\|\s*`?([^|`]+)`?\s*\|", text, re.MULTILINE) or re.findall(r"^\s*(\S+)", text, re.MULTILINE)
    return set(rows)


def verdicts(root: Path, folder: Path, board: str, profile: str) -> dict[str, str]:
    """Verdict of each requirement; the suite's status does not matter here."""
    program = root / ".venv/bin/psabench"
    argv = [str(program), "conform", "device", "--board", board, "--profile", profile, "--out", str(folder)]
    subprocess.run(argv, capture_output=True, cwd=root, check=False)
    found: dict[str, str] = json.loads((folder / "conform.json").read_text())["requirements"]
    return found


def compare(old: Path, new: Path, only: str, with_conform: bool) -> Outcome:
    outcome = Outcome()
    for listing in ("commands", "scpi", "faults", "keys", "profiles", "scenarios"):
        lost = names(old, f"--list-{listing}") - names(new, f"--list-{listing}")
        outcome.equal(f"--list-{listing}: gone: {sorted(lost)}", lost, set())
    with tempfile.TemporaryDirectory() as top:
        for name, scenario in scenarios(old, Path(top)):
            if only not in name:
                continue
            folders = [Path(tempfile.mkdtemp(dir=top)) for _ in range(6)]
            ran = [free_run(root, folder, scenario) for root, folder in zip((old, new), folders, strict=False)]
            for what in ran[0]:
                outcome.equal(f"{name}: {what}", ran[0][what], ran[1][what])
            state = [stepped(root, folder, scenario) for root, folder in zip((old, new), folders[2:], strict=False)]
            outcome.equal(
                f"{name}: state after {len(STEPS)} commands and {state[0][1]} faults", state[0][:2], state[1][:2]
            )
            outcome.equal(f"{name}: objects, bus", state[0][2], state[1][2])
            after = [restored(r, f, state[0][3]) for r, f in zip((old, new), folders[4:], strict=False)]
            outcome.equal(f"{name}: old snapshot, digest", after[0][0], after[1][0])
            outcome.equal(f"{name}: old snapshot, bus", after[0][1], after[1][1])
            frames = ran[0]["bus"].count(b"\n")
            print(f"{name}: {frames} frames, {len(ran[0]['lines'])} bytes of edges, {state[0][1]} faults", flush=True)
        for run in CONFORM.split() if with_conform else ():
            board, profile = run.split(":")
            folders = [Path(tempfile.mkdtemp(dir=top)) for _ in range(2)]
            found = [verdicts(root, f, board, profile) for root, f in zip((old, new), folders, strict=True)]
            outcome.equal(f"conform {run}: {diff(*found)}", found[0], found[1])
            print(f"conform {run}: {len(found[0])} verdicts", flush=True)
    return outcome


def diff(old: dict[str, str], new: dict[str, str]) -> list[str]:
    return [f"{i}: {old.get(i)} -> {new.get(i)}" for i in sorted(old | new) if old.get(i) != new.get(i)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path, metavar="OLD", help="checkout with build/psa-emu")
    parser.add_argument("new", type=Path, metavar="NEW")
    parser.add_argument("--conform", action="store_true", help="compare the suite's verdicts, too (minutes)")
    parser.add_argument("--only", default="", metavar="WORD", help="scenarios and profiles with this in their names")
    args = parser.parse_args()
    for root in (args.old, args.new):
        if not (root / "build/psa-emu").is_file():
            parser.error(f"{root}: expected a checkout with build/psa-emu")
    outcome = compare(args.old.resolve(), args.new.resolve(), args.only, args.conform)
    print(f"compared {outcome.compared}, different {len(outcome.different)}")
    return 1 if outcome.different else 0


if __name__ == "__main__":
    sys.exit(main())
