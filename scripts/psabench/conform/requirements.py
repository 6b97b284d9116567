"""The requirements of proto/requirements.yaml and proto/requirements/<group>.yaml, read once, checked to the letter.

A row says what a board or a host shall do, where that is written, how sure it is and how somebody sees it who has only
the wires. Figures that a test needs are in its `limits`, so that they are in one place.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from psabench.conform.profile import YAML_LOADER
from psabench.errors import BadInput, expected, path_found
from psabench.places import proto_file

Limit = int | float
INDEX = "requirements.yaml"
ID = re.compile(r"([A-Z]+[0-9]?)-[A-Z0-9]+-[0-9]{2}")
NAME = re.compile(r"[a-z][a-z0-9_]*")
# Where a statement may come from. The pages, their headings and the numbers are looked up by tools/gen_requirements.py.
SOURCE = re.compile(
    r"article, section [1-5](: .+)?|sources (instruments |can )?\d(\.\d)?|docs/[\w/]+\.md(#.+)?|proto/[\w/]+\.yaml"
    r"|CiA 301 \d+(\.\d+)*|ISO 11898-1"
)
TABLE = re.compile(r"(docs|proto)/[\w/]+\.(yaml|md)#[^#]+")
TEST = re.compile(r"tests/(unit/(\w+/)*test_\w+\.c:\w+|(py|e2e|golden)/(\w+/)*test_\w+\.py:test_\w+)")
INDEX_FIELDS = {"version", "grades", "observe", "kinds", "groups", "retired"}
GROUP_FIELDS = {"title", "prefixes", "boards", "rows"}
GROUP_OPTIONS = {"traits"}
TRAITS = frozenset({"parallel_bus"})
EVERY_BOARD, TAKEN_AWAY = "all", "!"  # in a list of boards
ROW_FIELDS = {"id", "text", "source", "grade", "kind"}
ROW_OPTIONS = {"original", "boards", "profiles", "observe", "unobservable", "limits", "table", "note", "proved_by"}


class RequirementsError(BadInput):
    """A file of requirements is not as it should be: file, row, what would be right."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """One row. `profiles` empty: all profiles of its boards. `observe` empty: `unobservable` says why.

    `original` is the article's sentence in its language, "" where there is none; `table` a table that says the rest.
    """

    id: str
    group: str
    text: str
    original: str
    source: tuple[str, ...]
    grade: str
    boards: tuple[str, ...]
    profiles: tuple[str, ...]
    kind: str
    observe: Mapping[str, str]
    unobservable: str
    limits: Mapping[str, Limit]
    table: str
    note: str
    proved_by: tuple[str, ...]

    def applies(self, board: str, profile: str) -> bool:
        """Does it hold for that board with that profile?"""
        return board in self.boards and (not self.profiles or profile in self.profiles)

    def limit(self, name: str) -> Limit:
        """A figure by name; its name ends in its unit. Raises KeyError with the names there are."""
        if name not in self.limits:
            raise KeyError(expected(", ".join(self.limits) or "no limit", repr(name), f"{self.id}: limit"))
        return self.limits[name]


@dataclass(frozen=True, slots=True)
class Group:
    """A file of rows; `prefixes` are the first words of its ids."""

    name: str
    title: str
    prefixes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Requirements:
    """All of them, with the words they are written in; each mapping is word to one line of explanation."""

    version: int
    grades: Mapping[str, str]
    ways: Mapping[str, str]
    kinds: Mapping[str, str]
    boards: Mapping[str, str]
    profiles: Mapping[str, str]  # shipped profile to its board
    groups: tuple[Group, ...]
    rows: Mapping[str, Requirement]

    def __getitem__(self, key: str) -> Requirement:
        if key not in self.rows:
            raise KeyError(expected("the id of a requirement", repr(key)))
        return self.rows[key]

    def __iter__(self) -> Iterator[Requirement]:
        return iter(self.rows.values())

    def __len__(self) -> int:
        return len(self.rows)

    def of(self, board: str, profile: str) -> tuple[Requirement, ...]:
        """Those that hold for a board with a shipped profile. Raises ValueError when there is no such pair."""
        if self.profiles.get(profile) != board:
            mine = [p for p, b in self.profiles.items() if b == board]
            raise ValueError(expected(", ".join(mine) or "no profile", repr(profile), f"profile of {board}"))
        return tuple(r for r in self if r.applies(board, profile))


class _Loader(YAML_LOADER):  # type: ignore[misc]
    """As SafeLoader, but a key that occurs twice is an error and not a value that vanishes."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(k, deep=True) for k, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.YAMLError(expected("each key once", f"{key} twice", f"line {node.start_mark.line + 1}"))
        return dict(super().construct_mapping(node, deep))


@cache
def requirements() -> Requirements:
    """Those that are shipped. Raises RequirementsError."""
    return load(proto_file(INDEX))


def load(index: Path) -> Requirements:
    """Read an index, and the groups and profiles in the folders beside it. Raises RequirementsError."""
    data = _mapping(_read(index), INDEX_FIELDS - {"retired"}, {"retired"}, index.name)
    where = index.name
    grades, ways, kinds = (_words(data[k], f"{where}: {k}") for k in ("grades", "observe", "kinds"))
    files = _group_files(index.parent / "requirements", _texts(data["groups"], f"{where}: groups"))
    boards, traits = _boards_and_traits(files)
    profiles = _profiles(index.parent / "profiles", boards)
    retired = set(_texts(data.get("retired", []), f"{where}: retired"))
    version = data["version"]
    _demand(type(version) is int and version >= 1, "a number from 1 on", repr(version), f"{where}: version")
    words = _Words(frozenset(grades), frozenset(ways), frozenset(kinds), tuple(boards), traits, profiles)
    groups = _group_heads(files)
    rows: dict[str, Requirement] = {}
    for group in groups:
        for row in _rows(f"{group.name}.yaml", files[group.name], group, words):
            _demand(row.id not in rows, "each id once", f"{row.id} twice", f"{group.name}.yaml")
            _demand(row.id not in retired, "a new id", f"{row.id} (retired)", f"{group.name}.yaml")
            rows[row.id] = row
    return Requirements(
        version=version,
        grades=MappingProxyType(grades),
        ways=MappingProxyType(ways),
        kinds=MappingProxyType(kinds),
        boards=MappingProxyType(boards),
        profiles=MappingProxyType(profiles),
        groups=groups,
        rows=MappingProxyType(rows),
    )


@dataclass(frozen=True, slots=True)
class _Words:
    grades: frozenset[str]
    ways: frozenset[str]
    kinds: frozenset[str]
    boards: tuple[str, ...]
    traits: Mapping[str, frozenset[str]]  # trait to the boards that have it
    profiles: Mapping[str, str]

    def known_boards(self, raw: Any, at: str) -> tuple[str, ...]:
        """Of a list of boards, traits and `all`, without those with a "!". Raises RequirementsError."""
        named = _texts(raw, at)
        some = [n for n in named if not n.startswith(TAKEN_AWAY)]
        away = {_one(n.removeprefix(TAKEN_AWAY), self.boards, at) for n in named if n.startswith(TAKEN_AWAY)}
        if not any(n == EVERY_BOARD or n in self.traits for n in some):
            return tuple(_one(n, (*self.boards, *self.traits, EVERY_BOARD), at) for n in some if n not in away)
        meant = {b for n in some for b in self.traits.get(n, self.boards if n == EVERY_BOARD else (n,))}
        return tuple(b for b in self.boards if b in meant - away)


def _demand(met: object, what: str, found: object, at: str) -> None:
    """Raises RequirementsError, with what was expected there and what was found, unless it is met."""
    if not met:
        raise RequirementsError(expected(what, found, at))


def _read(path: Path) -> Any:
    try:
        return yaml.load(path.read_text(encoding="utf-8"), _Loader)
    except OSError as e:
        raise RequirementsError(expected("requirements in YAML", path_found(e), path.name)) from e
    except yaml.YAMLError as e:
        raise RequirementsError(f"{path.name}: {' '.join(str(e).split())}") from e


def _profiles(folder: Path, boards: Mapping[str, str]) -> dict[str, str]:
    """Name to board of every shipped profile. One without `board:` is a PSA-2's."""
    found = {}
    for path in sorted(folder.glob("*.yaml")):
        data = _read(path)
        board = data.get("board", "psa2") if isinstance(data, dict) else ""
        _demand(board in boards, ", ".join(boards), repr(board), f"profiles/{path.name}: board")
        found[path.stem] = board
    return found


def _group_files(folder: Path, first: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Group to what its file says: the first ones in this order, then all others of the folder by name."""
    others = sorted({path.stem for path in folder.glob("*.yaml")} - set(first))
    paths = [folder / f"{name}.yaml" for name in (*first, *others)]
    return {path.stem: _mapping(_read(path), GROUP_FIELDS, GROUP_OPTIONS, path.name) for path in paths}


def _boards_and_traits(files: Mapping[str, dict[str, Any]]) -> tuple[dict[str, str], dict[str, frozenset[str]]]:
    """Every board with one line of explanation, and which of them have each trait."""
    boards: dict[str, str] = {}
    traits: dict[str, set[str]] = {trait: set() for trait in TRAITS}
    for name, data in files.items():
        own = _words(data["boards"], f"{name}.yaml: boards") if isinstance(data["boards"], dict) else {}
        if twice := boards.keys() & own.keys():
            raise RequirementsError(expected("boards of no other group", ", ".join(twice), f"{name}.yaml: boards"))
        boards |= own
        for trait in _known(data.get("traits", []), TRAITS, f"{name}.yaml: traits"):
            traits[trait] |= own.keys()
    _demand(boards, "a group file that defines a board", "none", "requirements")
    return boards, {trait: frozenset(having) for trait, having in traits.items()}


def _group_heads(files: Mapping[str, dict[str, Any]]) -> tuple[Group, ...]:
    groups: list[Group] = []
    for name, data in files.items():
        prefixes = _texts(data["prefixes"], f"{name}.yaml: prefixes")
        if taken := {p for g in groups for p in g.prefixes} & set(prefixes):
            raise RequirementsError(expected("prefixes of no other group", ", ".join(taken), f"{name}.yaml: prefixes"))
        groups.append(Group(name, _text(data["title"], f"{name}.yaml: title"), prefixes))
    return tuple(groups)


def _rows(file: str, data: dict[str, Any], group: Group, words: _Words) -> Iterator[Requirement]:
    boards = words.known_boards(
        list(data["boards"]) if isinstance(data["boards"], dict) else data["boards"], f"{file}: boards"
    )
    _demand(isinstance(data["rows"], list) and data["rows"], "a list of requirements", None, f"{file}: rows")
    for number, raw in enumerate(data["rows"], start=1):
        key = raw.get("id", f"row {number}") if isinstance(raw, dict) else f"row {number}"
        yield _row(_mapping(raw, ROW_FIELDS, ROW_OPTIONS, f"{file}: {key}"), group, boards, words, file)


def _row(raw: dict[str, Any], group: Group, boards: tuple[str, ...], words: _Words, file: str) -> Requirement:
    at = f"{file}: {raw['id']}"
    if not isinstance(raw["id"], str) or not (m := ID.fullmatch(raw["id"])) or m[1] not in group.prefixes:
        raise RequirementsError(expected(f"{' or '.join(group.prefixes)}, a topic, two digits", repr(raw["id"]), at))
    boards = words.known_boards(raw.get("boards", list(boards)), f"{at}: boards")
    profiles = _known(raw.get("profiles", []), frozenset(words.profiles), f"{at}: profiles")
    if strange := [p for p in profiles if words.profiles[p] not in boards]:
        raise RequirementsError(expected(f"profiles of {', '.join(boards)}", ", ".join(strange), f"{at}: profiles"))
    row = Requirement(
        id=raw["id"],
        group=group.name,
        text=_text(raw["text"], f"{at}: text"),
        original=_text(raw.get("original", ""), f"{at}: original", empty=True),
        source=_matching(raw["source"], SOURCE, f"{at}: source"),
        grade=_one(raw["grade"], words.grades, f"{at}: grade"),
        boards=boards,
        profiles=profiles,
        kind=_one(raw["kind"], words.kinds, f"{at}: kind"),
        observe=_observe(raw.get("observe", {}), words.ways, f"{at}: observe"),
        unobservable=_text(raw.get("unobservable", ""), f"{at}: unobservable", empty=True),
        limits=_limits(raw.get("limits", {}), f"{at}: limits"),
        table=_text(raw.get("table", ""), f"{at}: table", empty=True),
        note=_text(raw.get("note", ""), f"{at}: note", empty=True),
        proved_by=_matching(raw.get("proved_by", []), TEST, f"{at}: proved_by"),
    )
    for wrong, why in _WRONG:
        _demand(not wrong(row), why, None, at)
    return row


# What a row as a whole cannot be.
_WRONG: Sequence[tuple[Callable[[Requirement], bool], str]] = (
    (
        lambda r: " shall " not in r.text or not r.text.endswith("."),
        "a sentence with shall and a full stop as text",
    ),
    (lambda r: not r.source, "a source"),
    (lambda r: r.grade == "E1" and not r.original, "the article's sentence, `original`, with grade E1"),
    (
        lambda r: bool(r.original) and not any(s.startswith("article") for s in r.source),
        "the article among the sources of a row with `original`",
    ),
    (lambda r: bool(r.observe) == bool(r.unobservable), "either `observe` or the reason `unobservable`"),
    (
        lambda r: bool(r.table) and not TABLE.fullmatch(r.table),
        "a table like proto/psd1.yaml#bus",
    ),
)


def _mapping(raw: Any, needed: set[str], more: set[str], at: str) -> dict[str, Any]:
    if not isinstance(raw, dict):
        raise RequirementsError(expected("a mapping", type(raw).__name__, at))
    if unknown := [str(k) for k in raw if k not in needed | more]:
        raise RequirementsError(expected(", ".join(sorted(needed | more)), ", ".join(unknown), at))
    if missing := sorted(needed - raw.keys()):
        raise RequirementsError(expected(", ".join(missing), "none", at))
    return raw


def _words(raw: Any, at: str) -> dict[str, str]:
    _demand(isinstance(raw, dict) and raw, "a mapping of words to their meaning", type(raw).__name__, at)
    return {_text(k, at): _text(v, f"{at}: {k}") for k, v in raw.items()}


def _text(raw: Any, at: str, empty: bool = False) -> str:
    _demand(isinstance(raw, str) and (raw.strip() or empty), "a text", repr(raw), at)
    return " ".join(raw.split())


def _texts(raw: Any, at: str) -> tuple[str, ...]:
    texts = raw if isinstance(raw, list) else [raw]
    found = tuple(_text(t, at) for t in texts)
    _demand(len(set(found)) == len(found), "each item once", "one twice", at)
    return found


def _one(raw: Any, known: Collection[str], at: str) -> str:
    if raw not in known:
        raise RequirementsError(expected(", ".join(sorted(known)), repr(raw), at))
    return str(raw)


def _known(raw: Any, known: frozenset[str], at: str) -> tuple[str, ...]:
    return tuple(_one(t, known, at) for t in _texts(raw, at))


def _matching(raw: Any, pattern: re.Pattern[str], at: str) -> tuple[str, ...]:
    found = _texts(raw, at)
    if strange := [t for t in found if not pattern.fullmatch(t)]:
        raise RequirementsError(expected(f"the form {pattern.pattern}", repr(strange[0]), at))
    return found


def _observe(raw: Any, ways: frozenset[str], at: str) -> Mapping[str, str]:
    _demand(isinstance(raw, dict), "a mapping of ways to phrases", type(raw).__name__, at)
    return MappingProxyType({_one(k, ways, at): _text(v, f"{at}: {k}") for k, v in raw.items()})


def _limits(raw: Any, at: str) -> Mapping[str, Limit]:
    _demand(isinstance(raw, dict), "a mapping of names to numbers", type(raw).__name__, at)
    for name, value in raw.items():
        _demand(isinstance(name, str) and NAME.fullmatch(name), "a name like int_low_min_us", repr(name), at)
        _demand(type(value) in (int, float), "a number", repr(value), f"{at}: {name}")
    return MappingProxyType(dict(raw))
