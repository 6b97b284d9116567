#!/usr/bin/env python3
"""Who may include whom, and how large things may get: the shape of emu/ and nav/, enforced by `make lint`.

Usage: check_includes.py [ROOT]. Prints one line per breach and exits 1, or one line of figures and exits 0.
"""

import re
import statistics
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# A room is a folder of emu/ with sources, nav, or a folder of it: a layer, or a part of one ("chip/ads1282",
# "board/psa2"). A layer may include the layers of its row; parts do not include each other: may_include(). gen is
# generated from proto/.
_MODELS = {"base", "trace", "phys", "chip", "canopen", "board", "gen"}
_COMMANDS = _MODELS | {"board/*", "unit", "command", "fault"}
MAY_INCLUDE = {
    "base": set(),
    "trace": {"base"},
    "phys": {"base"},
    "chip": {"base"},
    "canopen": {"base"},
    "nav": set(),  # the installed headers
    "nav/common": {"nav"},
    "nav/north": {"nav", "nav/common"},
    "nav/filter": {"nav", "nav/common"},
    "nav/sins": {"nav", "nav/common", "nav/filter"},
    "nav/errors": {"nav", "nav/common", "nav/filter", "nav/sins"},
    "nav/strapdown": {"nav", "nav/common"},
    "nav/koi": {"nav", "nav/common", "nav/filter", "nav/sins"},
    "gen": {"base", "canopen"},
    "link": {"base"},
    "board": _MODELS,  # the contract of boards, and what boards share
    "board/*": _MODELS,
    "unit": _MODELS | {"board/*"},
    "command": _MODELS | {"unit"},
    "fault": _MODELS | {"unit", "command"},
    "control": _MODELS | {"unit", "command", "fault", "scenario"},
    "scpi": _MODELS | {"unit", "command", "fault", "control"},
    "scenario": _COMMANDS,
    "telemetry": _COMMANDS | {"link"},
    "bench": _COMMANDS | {"scenario", "control", "scpi", "link"},
    "api": {"base", "trace", "phys", "chip", "board", "board/*"},
    "app": _COMMANDS | {"control", "scpi", "scenario", "bench", "telemetry", "link"},
}
# What nav takes of emu: elementary functions of the same bytes on every machine.
NAV_FROM_EMU = {("nav/common", "emu/base/detmath.h")}
INSIDE = {"board/bins": "board/psa2"}  # a board that has another one inside
ONE_ROOM = {"app", "base", "phys", "link"}  # layers whose parts may include each other
# C11 without the headers of clocks, signals, locales, threads and jumps: those are the operating system's business.
C_HEADERS = set(
    "assert complex ctype errno fenv float inttypes iso646 limits math stdalign stdarg stdbool stddef stdint "
    "stdio stdlib stdnoreturn string tgmath".split()
)
CXX_HEADERS = set("algorithm array cmath cstddef cstdint cstring limits".split())  # of nav, which is C++
OS_FOLDERS = {"link", "app"}
# files and folders by their names
OS_FILES = {"bench/snapshot.c", "scenario/find.c", "scenario/series_file.c", "scenario/open.c"}
_JSON = {"command", "fault", "control", "scenario", "bench", "app"}
LIBRARIES = {
    "Eigen/Core": {"nav"},
    "Eigen/Dense": {"nav"},
    "Eigen/Geometry": {"nav"},
    "cjson/cJSON.h": _JSON,
    "cJSON.h": _JSON,
    "immintrin.h": {"chip"},  # the compiler's, for the vectors of x86-64
    "libfyaml.h": {"scenario"},
    "psabench/mavlink.h": {"link"},  # generated from proto/mavlink
}

KINDS = ("*.c", "*.h", "*.cpp", "*.hpp")
FUNCTION_REASON, FUNCTION_MAX, FUNCTION_MEDIAN = 40, 70, 15  # lines, braces included
SOURCE_MAX, HEADER_MAX = 600, 150  # lines; a file is about one topic, and the cap does not cut it
FLAT = {"psabench.h", "psabench_models.h"}  # include each other as they are installed
HEADER_EXCEPTIONS = {
    "emu/api/psabench.h": 250,
    "nav/koi.h": 200,
    "nav/nav.h": 250,
    "nav/sins.h": 250,
}  # installed alone: manuals of whole libraries
ONE_WORD = 33  # functions whose name is one word, which neither grep nor a backtrace finds; the goal is 60
REASON = re.compile(r"\blong:", re.IGNORECASE)  # in the comment above the function: "// Long: one row per opcode."
INCLUDE = re.compile(r'\s*#\s*include\s+([<"])([^>"]+)[>"]')


@dataclass(frozen=True)
class Function:
    """One function definition; lines counted from its opening brace to its closing one, both included."""

    path: Path
    line: int
    name: str
    length: int
    has_reason: bool


def functions(path: Path, text: list[str]) -> Iterator[Function]:
    """Find function bodies: in our format a brace alone in the first column opens nothing else."""
    start: int | None = None
    for number, line in enumerate(text):
        if line == "{":
            start = number
        elif line == "}" and start is not None:
            head = (
                start - 1
            )  # up to the line after the last blank, closing or preprocessor one: signature, then comment
            while head > 0 and text[head] and not text[head].startswith(("}", "#", "/*")):
                head -= 1
            above = text[head:start]
            signature = re.sub(r"/\*.*?\*/|//[^\n]*", "", "\n".join(above), flags=re.DOTALL)
            name = re.search(r"(\w+)\s*\((?!\()", re.sub(r"__attribute__\(\(.*?\)\)\)?", "", signature))
            yield Function(
                path,
                start,
                name.group(1) if name else "?",
                number - start + 1,
                any(line.startswith("//") and REASON.search(line) for line in above),
            )
            start = None


def layer(room: str) -> str:
    """The row of MAY_INCLUDE that a room obeys: board/psa2 -> board/*, chip/ads1282 -> chip, base -> base."""
    if room in MAY_INCLUDE:
        return room
    first, _, part = room.partition("/")
    return f"{first}/*" if part and f"{first}/*" in MAY_INCLUDE else first


def base_of(room: str) -> str:
    """What is before a room in a path from the root of the checkout."""
    return "" if room.partition("/")[0] == "nav" else "emu/"


def may_include(room: str, target_room: str, file: str) -> str:
    """Why a file of this room may not include that one, or nothing."""
    if target_room == room:
        return ""
    mine, its = layer(room), layer(target_room)
    same_layer = mine == its or (mine, its) == ("board", "board/*")
    if same_layer and room.partition("/")[0] in ONE_ROOM:
        return ""
    if (same_layer and INSIDE.get(room) != target_room) or its not in MAY_INCLUDE[mine] | {mine}:
        return f'{room} may not include {target_room} ("{target_room}/{file}")'
    if file.endswith("internal.h"):
        return f'"{target_room}/{file}" is for {target_room} alone'
    return ""


def include_breach(path: Path, room: str, bracket: str, target: str) -> str:
    """What is wrong with this include, or nothing."""
    folder = room.partition("/")[0]
    if bracket == "<":
        if target in LIBRARIES:
            return (
                "" if folder in LIBRARIES[target] else f"<{target}> belongs in {', '.join(sorted(LIBRARIES[target]))}"
            )
        if (
            target.removesuffix(".h") in C_HEADERS
            or folder in OS_FOLDERS
            or f"{room}/{path.name}" in OS_FILES
            or (folder == "nav" and target in CXX_HEADERS)
        ):
            return ""
        return f"<{target}> is an operating system's header: only {' and '.join(sorted(OS_FOLDERS))} may have those"
    if (room, target) in NAV_FROM_EMU:
        return ""
    where, _, file = target.rpartition("/")
    if (folder == "gen" and not where) or target in FLAT:
        return ""
    if ".." in where or layer(where) not in MAY_INCLUDE:
        return f'"{target}" must be written from the include root, as "base/sched.h"'
    return may_include(room, where, file)


def check_file(path: Path, folder: str) -> tuple[list[str], list[Function]]:
    """All breaches of one file, and its functions."""
    text = path.read_text(encoding="utf-8").splitlines()
    found: list[str] = []
    includes = [(n, m.group(1), m.group(2)) for n, line in enumerate(text, 1) if (m := INCLUDE.match(line))]
    for number, bracket, target in includes:
        if breach := include_breach(path, folder, bracket, target):
            found.append(f"{path}:{number}: {breach}")
    own = f"{folder}/{path.stem}.h"
    if folder == "gen":
        return found, []
    if path.suffix in (".c", ".cpp") and path.with_suffix(".h").exists() and (not includes or includes[0][2] != own):
        found.append(f'{path}:1: the first include must be the own header, "{own}"')
    limit = HEADER_MAX if path.suffix in (".h", ".hpp") else SOURCE_MAX
    limit = HEADER_EXCEPTIONS.get(f"{base_of(folder)}{own.removesuffix('.h')}{path.suffix}", limit)
    if len(text) > limit:
        found.append(f"{path}:{limit + 1}: {len(text)} lines, at most {limit}")
    bodies = list(functions(path, text))
    for f in bodies:
        if f.length > FUNCTION_MAX:
            found.append(f"{path}:{f.line}: {f.name}() has {f.length} lines, at most {FUNCTION_MAX}")
        elif f.length > FUNCTION_REASON and not f.has_reason:
            found.append(f'{path}:{f.line}: {f.name}() has {f.length} lines: say why above it, "// Long: ..."')
    return found, bodies


def main(root: Path) -> int:
    breaches: list[str] = []
    bodies: list[Function] = []
    files = 0
    rooms = {str(p.parent.relative_to(root / "emu")) for kind in KINDS for p in (root / "emu").rglob(kind)}
    rooms |= {str(p.parent.relative_to(root)) for kind in KINDS for p in (root / "nav").rglob(kind)}
    for room in sorted(rooms | {"gen"}):
        where = root / "build/gen" if room == "gen" else root / f"{base_of(room)}{room}"
        if layer(room) not in MAY_INCLUDE:
            breaches.append(f"{base_of(room)}{room}: a folder that is not in the include table")
            continue
        for path in sorted(p for kind in KINDS for p in where.glob(kind)):
            found, its = check_file(path, room)
            breaches += found
            bodies += its
            files += 1
    median = statistics.median([f.length for f in bodies] or [0])
    if median > FUNCTION_MEDIAN:
        breaches.append(f"emu: the median function has {median:g} lines, at most {FUNCTION_MEDIAN}")
    one_word = sorted(f"{f.path}:{f.line}: {f.name}()" for f in bodies if "_" not in f.name)
    if len(one_word) > ONE_WORD:
        breaches += [f"{name}: the name does not say its object" for name in one_word]
    print(f"one-word function names: {len(one_word)} (limit {ONE_WORD})")
    for line in breaches:
        print(line)
    longest = max(bodies, key=lambda f: f.length, default=None)
    with_reason = sorted(f"{f.name} {f.length}" for f in bodies if f.length > FUNCTION_REASON)
    print(
        f"includes and sizes: {files} files, {len(bodies)} functions, median {median:g} lines"
        + (f", longest {longest.name}() {longest.length}" if longest else "")
        + (f"; past {FUNCTION_REASON} lines: {', '.join(with_reason)}" if with_reason else "")
        + (f"; {len(breaches)} breaches" if breaches else "")
    )
    return 1 if breaches else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path()))
