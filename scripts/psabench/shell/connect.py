"""Which bench a session is with: an emulator started for it, one that is there, or a device on a bus."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from psabench.bench import NONE, Bench
from psabench.errors import BadInput, expected
from psabench.instruments import KINDS
from psabench.shell.commands import Arg, Command, Kind, Vocabulary
from psabench.shell.grammar import parse
from psabench.shell.lexer import quote

START = Command(
    name="start",
    what="The first line of a script: an emulator is started for it.",
    args=(
        Arg(name="scenario", what="name or file"),
        Arg(name="seed", kind=Kind.COUNT, optional=True, low=0, high=2**63, what="of all noise"),
        Arg(name="pace", kind=Kind.CHOICE, optional=True, choices=("step", "wall"), what="step without it"),
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Opening:
    """connect: control socket of an emulator that is there. Without connect and can an emulator is started."""

    scenario: str | None = None
    pace: str | None = None  # step, unless a script says otherwise
    seed: int | None = None
    connect: Path | None = None
    can: str | None = None
    scpi: Mapping[str, str] = field(default_factory=dict)
    node: int | None = None

    @property
    def given(self) -> bool:
        """Whether it says which bench."""
        return self.there or self.scenario is not None

    @property
    def there(self) -> bool:
        """Whether the bench is there already."""
        return bool(self.connect or self.can or self.scpi)

    @property
    def start(self) -> str:
        """The line of a script that brings up the same bench; "" for one that was there."""
        if self.there:
            return ""
        seed = "" if self.seed is None else f" seed={self.seed}"
        return f"start {quote(self.scenario or 'calibrate')}{seed}"

    def open(self) -> Bench:
        """Raises BenchError."""
        if not self.there:
            return Bench.start(self.scenario or "calibrate", pace=self.pace or "step", seed=self.seed, node=self.node)
        if self.scenario is not None:
            raise BadInput(expected("no scenario with --connect or --can", repr(self.scenario), "SCENARIO"))
        can = self.can or (None if self.connect else NONE)  # an emulator tells its own
        return Bench.connect(can, control=self.connect, scpi=self.scpi, node=self.node)

    def of_script(self, first: str) -> Opening:
        """As the first line of a script says, unless the bench is there already. Raises Wrong."""
        call = parse(first, Vocabulary({"start": START})) if first.split()[:1] == ["start"] else None
        if call is None or self.there:
            return self
        seed = call.args.get("seed")
        return replace(
            self,
            scenario=self.scenario or str(call.args["scenario"]),
            seed=self.seed if self.seed is not None or seed is None else int(float(str(seed))),
            pace=self.pace or str(call.args.get("pace", "step")),
        )


def addresses(pairs: list[str]) -> dict[str, str]:
    """`--scpi NAME=ADDRESS`, as often as given. Raises BadInput."""
    found = {}
    for pair in pairs:
        name, equals, address = pair.partition("=")
        if name not in KINDS or not equals or not address:
            raise BadInput(expected(f"NAME=VISA-ADDRESS, NAME one of {', '.join(KINDS)}", repr(pair), "--scpi"))
        found[name] = address
    return found
