#!/usr/bin/env python3
"""What the compiled core must not contain: mutable globals, allocation, output, clocks, inexact libm, circles.

Usage: check_symbols.py OBJECT_ROOT (build/obj). Reads every object below emu/ and nav/; those of link, scenario, bench
and app may do all this, but for circles: files, or folders, that call each other, directly or through others. Two
compilers or machines give equal bytes only while no result depends on a libm whose last digit is its own.
"""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

FREE_FOLDERS = {"link", "app", "bench", "scenario"}
CXX_FOLDERS = {"nav"}
ROOTS = ("emu", "nav")
CIRCLES = 0, 3  # of symbols between folders, and in all; the goal is 0 and 6
ALLOCATOR_FOLDERS = {"command", "control", "fault", "scpi", "api"}  # through cJSON; the library's benches and parts
LIBM = (
    "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 expm1 "
    "log log2 log10 log1p pow cbrt hypot erf erfc tgamma"
)
FORBIDDEN = {
    **{
        name + suffix: "differs between machines: use base/detmath.h"
        for name in (*LIBM.split(), "sincos")
        for suffix in ("", "f", "l")
    },
    **dict.fromkeys("malloc calloc realloc free strdup aligned_alloc _Znwm _ZdlPv".split(), "allocates"),
    **dict.fromkeys("__cxa_guard_acquire __cxa_throw __gxx_personality_v0".split(), "needs the runtime of C++"),
    **dict.fromkeys(
        "printf fprintf vprintf vfprintf puts putchar fputs perror __printf_chk __fprintf_chk".split(), "prints"
    ),
    **dict.fromkeys(
        "time clock clock_gettime gettimeofday nanosleep usleep".split(), "reads a clock: time is an argument"
    ),
    **dict.fromkeys("rand srand random srandom drand48 getrandom".split(), "is not ours to seed: use base/rng.h"),
    **dict.fromkeys("exit _exit abort getenv".split(), "is for emu/app to decide"),
}


def room_of(root: Path, path: Path) -> Path:
    """base/sched of ROOT/emu/base/sched, nav/north of ROOT/nav/north."""
    own = path.relative_to(root)
    return own.relative_to("emu") if own.parts[0] == "emu" else own


def tables(command: Sequence[str], objects: Sequence[Path]) -> Iterator[tuple[Path, str]]:
    """Lines of nm -A, each with its object; one process for all, since starting one for each takes most of the time."""
    if not objects:  # nm would look for a.out
        return
    out = subprocess.run([*command, *objects], capture_output=True, text=True, check=True).stdout
    for line in out.splitlines():
        path, _, rest = line.partition(": ")
        yield Path(path), rest


def undefined(objects: Sequence[Path]) -> dict[Path, list[str]]:
    """Names that each object needs."""
    names: dict[Path, list[str]] = {path: [] for path in objects}
    for path, line in tables(["nm", "-A", "-u", "--format=posix"], objects):
        names[path].append(line.split()[0].split("@")[0])
    return names


def mutable(objects: Sequence[Path]) -> dict[Path, list[str]]:
    """Names of data objects in writable sections of each object; .data.rel.ro is constant after loading."""
    names: dict[Path, list[str]] = {path: [] for path in objects}
    if not objects:
        return names
    out = subprocess.run(["objdump", "-t", *objects], capture_output=True, text=True, check=True).stdout
    path = objects[0]
    for line in out.splitlines():
        name, header, _ = line.partition(":     file format ")
        if header:
            path = Path(name)
            continue
        fields = line.split()
        section = next((f for f in fields if f in {"*COM*"} or f.startswith((".data", ".bss", ".tbss", ".tdata"))), "")
        is_object = " O " in line[:30] or section == "*COM*"
        if is_object and section and not section.startswith(".data.rel.ro"):
            names[path].append(fields[-1])
    return names


def calls(objects: Sequence[Path]) -> dict[Path, set[Path]]:
    """Each object with the others that define what it needs."""
    defined = tables(["nm", "-A", "-g", "--defined-only", "--format=posix"], objects)
    home = {line.split()[0]: path for path, line in defined}
    return {path: {home[n] for n in names if n in home} - {path} for path, names in undefined(objects).items()}


def circles(graph: dict[Path, set[Path]]) -> list[list[Path]]:
    """Sets of two or more nodes that all reach each other."""
    reach = {node: set(to) for node, to in graph.items()}
    for middle in graph:
        for to in reach.values():
            if middle in to:
                to |= reach[middle]
    mutual = {frozenset({a} | {b for b in reach[a] if a in reach.get(b, ())}) for a in reach if a in reach[a]}
    return sorted(sorted(group) for group in mutual if len(group) > 1)


def circle_breaches(root: Path, objects: list[Path], limits: tuple[int, int] = CIRCLES) -> list[str]:
    """Circles between folders, and those between files, where there are more than the limits."""
    name = {path: room_of(root, path).with_suffix("") for path in objects}
    files = {name[a]: {name[b] for b in to} for a, to in calls(objects).items()}
    folders: dict[Path, set[Path]] = {}
    for a, to in files.items():
        folders.setdefault(a.parent, set()).update(b.parent for b in to if b.parent != a.parent)
    found = circles(folders), circles(files)
    for groups, limit, where in zip(found, limits, ("between folders", "in all"), strict=True):
        print(f"symbol circles {where}: {len(groups)} (limit {limit})")
    over = [group for groups, limit in zip(found, limits, strict=True) if len(groups) > limit for group in groups]
    return [f"circle: {', '.join(map(str, group))}" for group in over]


def main(root: Path) -> int:
    breaches = []
    objects = sorted(path for folder in ROOTS for path in (root / folder).rglob("*.o"))
    needed, writable = undefined(objects), mutable(objects)
    for path in objects:
        room = room_of(root, path.parent)
        folder = room.parts[0]
        if folder in FREE_FOLDERS:
            continue
        source = path.relative_to(root).with_suffix(".cpp" if folder in CXX_FOLDERS else ".c")
        breaches += [f"{source}: mutable global {name}" for name in writable[path]]
        for name in needed[path]:
            if name in FORBIDDEN and not (folder in ALLOCATOR_FOLDERS and FORBIDDEN[name] == "allocates"):
                breaches.append(f"{source}: calls {name}(), which {FORBIDDEN[name]}")
    breaches += circle_breaches(root, objects)
    for line in breaches:
        print(line)
    print(f"symbols: {len(objects)} objects, {len(breaches)} breaches")
    return 1 if breaches or not objects else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/obj")))
