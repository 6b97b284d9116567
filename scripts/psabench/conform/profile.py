"""What a board is said to be: its type and its profile, with the figures that the profile's page gives.

The user says it (`--board psa2 --profile w24`); nothing here asks the board. Profiles are read as documentation of a
variant: the figures that the article leaves open (docs/boards/*.md, open questions).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from psabench.boards.registry import ALIASES, NAMES, of_name
from psabench.errors import BadInput, expected
from psabench.places import proto_file

YAML_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml's where there is one: ten times faster


def proto_yaml(name: str) -> Any:
    """Contents of a YAML file of proto/. Raises BadInput where there is none."""
    return yaml.load(proto_file(name).read_text(encoding="utf-8"), YAML_LOADER)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """A board with one reading of what its article leaves open."""

    board: str  # as the user says: psa1
    family: str  # whose protocol it speaks: psa2
    profile: str
    figures: Mapping[str, Any]  # keys of the profile

    def __getitem__(self, key: str) -> Any:
        """A figure of the profile. Raises BadInput where it has none."""
        if key not in self.figures:
            raise BadInput(expected(f"a profile with {key}", "none", f"profile {self.profile}"))
        return self.figures[key]

    @property
    def name(self) -> str:
        """As reports show it."""
        return self.board if self.board == self.profile else f"{self.board}, profile {self.profile}"


def variant(board: str, profile: str | None = None) -> Variant:
    """Raises BadInput for a board or a profile that there is not, or a profile of another board."""
    known = of_name(board)
    if known is None:
        raise BadInput(expected(", ".join(NAMES), repr(board), "board"))
    family = known.name
    name = profile or (known.profile if board == family and known.profile else board)
    figures = _figures(name)
    of = figures.get("board", "psa2")
    if ALIASES.get(of, of) != family:
        raise BadInput(expected(f"one of {board}", f"{name}, one of {of}", "profile"))
    return Variant(board=board, family=family, profile=name, figures=figures)


def _figures(profile: str) -> Mapping[str, Any]:
    if not profile.isidentifier():
        raise BadInput(expected("a name that psa-emu --list-profiles prints", repr(profile), "profile"))
    try:
        found = proto_yaml(f"profiles/{profile}.yaml")
    except BadInput as e:
        raise BadInput(expected("a name that psa-emu --list-profiles prints", repr(profile), "profile")) from e
    if not isinstance(found, dict):
        raise BadInput(expected("a mapping", type(found).__name__, f"profile {profile}"))
    return found
