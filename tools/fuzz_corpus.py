#!/usr/bin/env python3
"""The fuzz corpus: one text file per target, tests/fuzz/corpus/TARGET.txt. docs/fuzzing.md

A line is an input: its name, a blank, its bytes in hexadecimal digits (none for the empty input). Lines are sorted by
name. A name is what libFuzzer called the file (the SHA-1 of its bytes) or a word of [A-Za-z0-9_.-].
"""

from __future__ import annotations

import argparse
import hashlib
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CORPUS = ROOT / "tests/fuzz/corpus"
BUILD = ROOT / "build-fuzz"
NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")

EPILOG = """\
examples:
  tools/fuzz_corpus.py unpack build-fuzz/seeds psa2     write the inputs as files into build-fuzz/seeds/fuzz_psa2
  tools/fuzz_corpus.py add psa2 crash-1 --name late     add one input
  tools/fuzz_corpus.py merge psa2                       add the fewest finds of build-fuzz/corpus that reach new edges
"""


def archive(target: str) -> Path:
    """The file of a target, whose name may begin with fuzz_ or not."""
    return CORPUS / f"fuzz_{target.removeprefix('fuzz_')}.txt"


def read(path: Path) -> dict[str, bytes]:
    """Inputs by name. Raises ValueError with the file and line, OSError."""
    inputs: dict[str, bytes] = {}
    for number, line in enumerate(path.read_text(encoding="ascii").splitlines(), 1):
        name, _, digits = line.partition(" ")
        try:
            content = bytes.fromhex(digits)
        except ValueError:
            content = None
        if content is None or not NAME.fullmatch(name) or name in inputs:
            raise ValueError(f"{path}:{number}: expected a new name and hexadecimal bytes, got {line[:60]!r}")
        inputs[name] = content
    return inputs


def write(path: Path, inputs: Mapping[str, bytes]) -> None:
    """Write the whole file or leave the old one."""
    if wrong := [name for name in inputs if not NAME.fullmatch(name)]:
        raise ValueError(f"{path}: expected names of letters, digits, _, . and -, got {wrong[0]!r}")
    draft = path.with_name(path.name + ".part")
    draft.write_text("".join(f"{n} {inputs[n].hex()}".rstrip() + "\n" for n in sorted(inputs)), encoding="ascii")
    draft.replace(path)


def unpack(folder: Path, targets: Sequence[str]) -> None:
    """Write each target's inputs as files into FOLDER/fuzz_TARGET, and nothing else there."""
    for target in targets:
        source = archive(target)
        there = folder / source.stem
        shutil.rmtree(there, ignore_errors=True)
        there.mkdir(parents=True)
        for name, content in (read(source) if source.exists() else {}).items():
            (there / name).write_bytes(content)


def pack(folder: Path, targets: Sequence[str]) -> None:
    """Make each target's file from the files in FOLDER/fuzz_TARGET."""
    for target in targets:
        there = folder / archive(target).stem
        if not there.is_dir():
            raise ValueError(f"{there}: expected a folder of inputs")
        write(archive(target), {p.name: p.read_bytes() for p in there.iterdir()})


def add(target: str, files: Sequence[Path], name: str | None) -> int:
    """Add inputs by NAME or their SHA-1. How many were not there."""
    path = archive(target)
    inputs = read(path) if path.exists() else {}
    before = len(inputs)
    for file in files:
        content = file.read_bytes()
        if content not in inputs.values():
            key = name or hashlib.sha1(content, usedforsecurity=False).hexdigest()
            if key in inputs:
                raise ValueError(f"{path}: {key} is there already, with other bytes")
            inputs[key] = content
    write(path, inputs)
    return len(inputs) - before


def merge(target: str, found: Path) -> int:
    """Add the fewest files of FOUND that reach edges which the corpus does not. How many were added."""
    binary = BUILD / "fuzz" / archive(target).stem
    with tempfile.TemporaryDirectory() as scratch:
        unpack(Path(scratch), [target])
        there = Path(scratch) / archive(target).stem
        command = [str(binary), "-set_cover_merge=1", "-use_counters=0", str(there), str(found)]
        subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return add(target, sorted(there.iterdir()), None)


def parser() -> argparse.ArgumentParser:
    """Command line."""
    p = argparse.ArgumentParser(
        prog="fuzz_corpus.py", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = p.add_subparsers(dest="command", required=True)
    for name, way in (("unpack", "into"), ("pack", "from")):
        one = commands.add_parser(name, help=f"{name} the targets' inputs {way} FOLDER")
        one.add_argument("folder", type=Path, metavar="FOLDER", help="with a folder fuzz_TARGET for each target")
        one.add_argument("targets", nargs="+", metavar="TARGET")
    one = commands.add_parser("add", help="add inputs to a target's file")
    one.add_argument("target", metavar="TARGET")
    one.add_argument("files", nargs="+", type=Path, metavar="FILE")
    one.add_argument("--name", help="name of the input (default: SHA-1 of its bytes)")
    one = commands.add_parser("merge", help="add what `make fuzz` found, as few inputs as reach the same edges")
    one.add_argument("target", metavar="TARGET")
    one.add_argument("--found", type=Path, metavar="FOLDER", help="default: build-fuzz/corpus/fuzz_TARGET")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: 0, or 2 for bad input."""
    args = parser().parse_args(argv)
    try:
        if args.command == "unpack":
            unpack(args.folder, args.targets)
        elif args.command == "pack":
            pack(args.folder, args.targets)
        elif args.command == "add":
            print(f"{archive(args.target).name}: {add(args.target, args.files, args.name)} added")
        else:
            found = args.found or BUILD / "corpus" / archive(args.target).stem
            print(f"{archive(args.target).name}: {merge(args.target, found)} added")
    except (ValueError, OSError, subprocess.CalledProcessError) as e:
        print(f"fuzz_corpus: {e}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
