"""`psabench run`: procedures over the wire, graded and reported.

Without --can it starts the emulator itself, once per reading of the article: quiet (the reading in which the printed
figures can be reproduced) and realistic (what the same procedure finds with honest noise). With --can and --head, or
the --control of an emulator, it runs against what is there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from psabench.bench import Bench
from psabench.boards.psa2.device import CODE_V, WORD_V
from psabench.boards.registry import DBC_NODE
from psabench.budget.accuracy import EXACT, BenchAccuracy
from psabench.budget.influences import expand_result
from psabench.emulator import read_resolved
from psabench.errors import BadInput, expected
from psabench.instruments import EXAMPLES
from psabench.logs.call_log import check_procedure, refuse_beside_replay
from psabench.options import refuse_beside
from psabench.procedures.command_line.offered import CONDITIONS, G_MPS2, Condition
from psabench.procedures.head_bench import HeadBench, Progress, Watch
from psabench.procedures.recorded_head import HeadRecorder, RecordedHead
from psabench.procedures.recording import CsvRecorder
from psabench.procedures.registry import PROCEDURES, Procedure
from psabench.procedures.result import fields_of, made_params
from psabench.procedures.wire_bench import WireBench
from psabench.progress import interval_log
from psabench.report import calibration as report
from psabench.report.grading import Section
from psabench.report.nominal import Nominal, nominal_dict, nominal_of_dict, nominal_of_scenario, read_passport
from psabench.report.zero_watch import ZeroWatch


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """What the command line asked for."""

    procedures: Sequence[str]
    out: Path
    conditions: Sequence[str] = ("quiet", "realistic")
    can: str | None = None  # python-can spec of a bench that is already there
    head: str | None = None  # VISA address of that bench's dividing head
    control: Path | None = None  # of an emulator: moves its time, and tells can and head
    truth: Path | None = None
    scenario: Path | None = None  # instead of the conditions' own
    node: int = DBC_NODE
    average: int | None = None
    real_time: bool = False
    seed: int | None = None
    g_mps2: float | None = None  # local gravity; None: the condition's, standard gravity on another bench
    record: Path | None = None  # CAN log of the run, its calls beside it
    replay: Path | None = None  # such a log instead of a bench
    passport: Path | None = None  # nominal values of the sensor
    params: Mapping[str, Any] | None = None  # fields of the procedures' parameters, by name

    def average_for(self, c: Condition) -> int:
        return c.average if self.average is None else self.average

    def gravity_for(self, c: Condition) -> float:
        return c.g_mps2 if self.g_mps2 is None else self.g_mps2

    def refuse_one_bench(self, way: str) -> None:
        """A recording, a passport or addresses of one sensor on a head, beside another way to run. Raises BadInput."""
        names = ("record", "replay", "passport", "can", "head")
        refuse_beside(way, {f"--{name}": getattr(self, name) for name in names}, "run")


def run(options: RunOptions, progress: Progress) -> tuple[Path, list[Section], Nominal | None]:
    """Every procedure under every condition; writes the report. Raises BenchError; Ctrl-C keeps the readings taken.

    Returns the page, what it shows, and what the sensor is said to be.
    """
    passport = None if options.passport is None else read_passport(options.passport)
    if options.replay:
        return _replay_run(options, progress, passport)
    if options.record and len(options.procedures) * len(_conditions(options)) != 1:
        raise BadInput(expected("one procedure on one bench (--condition quiet or realistic)", "several", "--record"))
    options.out.mkdir(parents=True, exist_ok=True)
    sections = [
        measure_section(PROCEDURES[n], c, options, progress) for c in _conditions(options) for n in options.procedures
    ]
    nominal = passport or nominal_of(options, sections[0].result.axis)
    return report.write(options.out, sections, facts_of(options), nominal), sections, nominal


def _conditions(options: RunOptions) -> list[Condition]:
    if _there(options) or options.scenario:
        average = 16 if options.average is None else options.average
        return [Condition(label="", scenario=str(options.scenario or ""), average=average, g_mps2=G_MPS2)]
    return [CONDITIONS[c] for c in options.conditions]


def measure_section(procedure: Procedure, condition: Condition, options: RunOptions, progress: Progress) -> Section:
    """One procedure on one bench, with its budget; stores the readings and the resolved scenario. Raises BenchError."""
    params = made_params(procedure.params, procedure.name, options.params or {})
    accuracy = accuracy_of(EXACT if condition.exact else {}, options)
    average, g_mps2 = options.average_for(condition), options.gravity_for(condition)
    stem = "-".join(x for x in (procedure.name, condition.label) if x)
    with ExitStack() as stack:
        bench = stack.enter_context(open_bench(condition, options))
        wired = WireBench(bench.unit, bench.head, average=average, g_mps2=g_mps2)
        on_head: HeadBench = wired
        if options.record:
            setup = {"procedure": procedure.name, "condition": condition.label, "average": average, "g_mps2": g_mps2}
            setup |= {"node": bench.unit.node.node_id, "filter_gain": wired.filter_gain, "facts": facts_of(options)}
            setup |= {"accuracy": asdict(accuracy)}
            setup |= {"nominal": nominal_dict(nominal_of(options, params.axis))}
            on_head = stack.enter_context(HeadRecorder(wired, bench.host, options.record, setup))
        m = Measurement(
            procedure=procedure,
            params=params,
            accuracy=accuracy,
            average=average,
            label=condition.label,
            csv=options.out / f"{stem}.csv",
        )
        return measure_on(bench, on_head, m, progress)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """What is measured on a bench that is there."""

    procedure: Procedure
    params: Any
    accuracy: BenchAccuracy
    average: int  # samples in a reading, 0: whole words
    label: str
    csv: Path


def measure_on(bench: Bench, head: HeadBench, m: Measurement, progress: Progress) -> Section:
    """A procedure on an open bench, with its budget; stores the readings. Raises BenchError."""
    with CsvRecorder(m.csv) as recorder:
        zero = ZeroWatch(recorder, lambda: bench.time_s, lambda: _zero_moved_v(bench, m.params.axis))
        watched = zero if bench.truth_path else recorder
        result = m.procedure.run(head, m.params, Watch(progress=progress, record=watched, estimated=interval_log()))
    truth = axis_truth(next(iter(bench.truth()["units"].values())), m.params.axis) if bench.truth_path else None
    moved_v = zero.moved_v(result.readings) if truth else ()
    result = expand_result(result, m.procedure, m.params, m.accuracy, _step_v(m.average))
    return Section(label=m.label, result=result, truth=truth, zero_moved_v=moved_v)


def accuracy_of(known: Mapping[str, float], options: RunOptions) -> BenchAccuracy:
    """What the user gave, else what is known of this bench, else the figures of our chain and head."""
    given = {**known, **fields_of(BenchAccuracy, options.params or {})}
    return made_params(BenchAccuracy, "accuracy of the bench", given)


def _step_v(average: int) -> float:
    """Resolution of one reading: the mean of `average` codes, or a whole word."""
    return CODE_V if average else WORD_V


def _replay_run(
    options: RunOptions, progress: Progress, passport: Nominal | None
) -> tuple[Path, list[Section], Nominal | None]:
    """The procedure that was recorded, on the recording: the same results and report, but for a truth."""
    assert options.replay is not None
    head = RecordedHead(options.replay)
    name = str(head.setup["procedure"])
    check_procedure(options.replay, head.setup, " ".join(options.procedures))
    given: dict[str, object] = {"--record": options.record, "--can": options.can, "--head": options.head}
    given |= {"--control": options.control, "--truth": options.truth, "--scenario": options.scenario}
    refuse_beside_replay(given | {"--seed": options.seed, "--average": options.average, "--gravity": options.g_mps2})
    options.out.mkdir(parents=True, exist_ok=True)
    procedure, label = PROCEDURES[name], str(head.setup.get("condition", ""))
    params = made_params(procedure.params, name, options.params or {})
    with CsvRecorder(options.out / f"{'-'.join(x for x in (name, label) if x)}.csv") as recorder:
        result = procedure.run(head, params, Watch(progress=progress, record=recorder, estimated=interval_log()))
    accuracy = accuracy_of(dict(head.setup.get("accuracy", {})), options)
    result = expand_result(result, procedure, params, accuracy, _step_v(int(head.setup["average"])))
    section = Section(label=label, result=result, truth=None)
    facts = {str(k): str(v) for k, v in head.setup["facts"].items()}
    nominal = passport or nominal_of_dict(head.setup.get("nominal"))
    return report.write(options.out, [section], facts, nominal), [section], nominal


def _there(options: RunOptions) -> bool:
    """Whether the bench is there already; else an emulator is started."""
    return bool(options.can or options.head or options.control)


def open_bench(condition: Condition, options: RunOptions, *, every_unit: bool = False) -> Bench:
    """The bench that is there, or of an emulator; with the unit of --node alone, or with every one."""
    node = None if every_unit else options.node
    if _there(options):
        if not options.head and not options.control:
            raise BadInput(expected(f"the VISA address of the dividing head, as {EXAMPLES}", "none", "--head"))
        there = {"head": options.head} if options.head else {}
        return Bench.connect(options.can, scpi=there, control=options.control, truth=options.truth, node=node)
    scenario = options.scenario or condition.scenario
    pace = "wall" if options.real_time else "step"
    extra: list[str | Path] = ["--resolved", _resolved(condition, options)]
    return Bench.start(scenario, pace=pace, seed=options.seed, node=node, extra=extra)


def _resolved(condition: Condition, options: RunOptions) -> Path:
    """Every key with its value, and the seed: the run can be repeated from it."""
    return options.out / ("-".join(x for x in ("scenario", condition.label) if x) + ".json")


def nominal_of(options: RunOptions, axis: str) -> Nominal | None:
    """What the scenario says of the sensor, once its bench has been there; None: the bench is not ours."""
    if _there(options):
        return None
    condition = _conditions(options)[0]
    resolved = read_resolved(_resolved(condition, options))
    return nominal_of_scenario(resolved, axis, options.node, Path(condition.scenario).name)


def axis_truth(unit: Mapping[str, Any], axis: str) -> Mapping[str, float]:
    """Of a unit's truth, the numbers of one sensor."""
    return {k: float(v) for k, v in unit["axes"][axis].items() if isinstance(v, int | float)}


def _zero_moved_v(bench: Bench, axis: str) -> float:
    return float(bench.truth_state()["unit"]["zero_moved_v"]["xyz".index(axis)])


def facts_of(options: RunOptions) -> dict[str, str]:
    """For the head of the page, once the benches have been there."""
    there = " ".join(str(x) for x in (options.can, options.head, options.control) if x)
    where = there or str(options.scenario or ", ".join(CONDITIONS[c].scenario for c in options.conditions))
    seeds = {} if there else {read_resolved(_resolved(c, options))["seed"]: None for c in _conditions(options)}
    seed = {"seed": ", ".join(map(str, seeds))} if seeds else {}
    return {"bench": where, **seed, "pace": "real time" if options.real_time else "simulated time"}
