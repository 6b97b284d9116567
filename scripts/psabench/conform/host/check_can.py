"""What a host on CAN must have told of each case."""

from __future__ import annotations

import itertools

import numpy as np

from psabench.boards.objects import Common, Psa2Objects
from psabench.conform.host.capture import SDO_RX, SDO_TX, SEQS, WRAP_US, Frame, number
from psabench.conform.host.cases_units import UNIT_CASES
from psabench.conform.host.check import HostCapture, checks, enough, limits
from psabench.conform.verdict import Failed, Unseen, expect, none_of

READ, ABORT = 0x40, 0x80  # command specifiers of SDO
FAST, TOG = 0x380, 63  # PSA2_FAST, and the bit of it that tells the frame's number, even or odd
REGISTERS = (
    (Psa2Objects.REG_X, 2),
    (Psa2Objects.REG_Y, 2),
    (Psa2Objects.REG_Z, 2),
    (Psa2Objects.REG_T, 1),
    (Psa2Objects.REG_T, 4),
)  # CONFIG0 of X, Y, Z; STATUS, DRATE
ENDS = ("line_good", *(name for name, case in UNIT_CASES.items() if case.ends))  # cases of other boards and links
IDENTITY = (Common.DEVICE_TYPE, Common.DEVICE_NAME, Common.IDENTITY)  # any of them says who is there


@checks("HOST-RES-01", "good")
def every_sample_is_told_once_and_in_order(e: HostCapture) -> str:
    """The numbers of the samples told, against those on the bus."""
    return f"{len(e.samples().pairs)} samples"


@checks("HOST-RES-02", "good")
def nothing_is_told_that_was_not_played(e: HostCapture) -> str:
    """Everything told of ten seconds of a good board."""
    e.nothing_but()
    none_of(e.match.strange, lambda s: f"sample {s.number}, which was not sent", "none")
    return f"{len(e.told.samples)} samples and no fault"


@checks("HOST-RES-03", "good", *ENDS)
def the_end_is_told(e: HostCapture) -> str:
    """The link ends: the last word, and the exit status."""
    if e.told.of("end") != [True] or e.told.events[-1].name != "end" or e.told.events[-1].at != e.told.count:
        raise Failed(f"{len(e.told.of('end'))} ends", '{"end": true} once, as the last word')
    expect(e.status == 0, "it had to be ended" if e.status is None else f"exit status {e.status}", "exit status 0")
    return "end told, exit status 0"


@checks("HOST-RES-04", "good", *ENDS)
def every_line_is_of_the_results_channel(e: HostCapture) -> str:
    """The lines told, against the words of the results channel."""
    enough(e.told.count or e.told.events or e.told.bad_lines, "a line")
    none_of(e.told.bad, lambda x: f"{e.told.bad_lines} lines that are none; said {x}", "docs/conform_host.md")
    return f"{e.told.count + len(e.told.events)} lines"


@checks("HOST-CAN-11", "good")
def codes_are_those_that_were_sent(e: HostCapture) -> str:
    """Codes of X, Y, Z and T and the channel of T, each of another size and sign."""
    enough(e.match.pairs, "a sample")
    if e.match.wrong:
        s, p = e.match.wrong[0]
        raise Failed(f"{s.codes}, channel {s.channel}, of sample {s.number}", f"{p.codes}, channel {p.channel}")
    return f"{len(e.match.pairs)} samples, the last {e.match.pairs[-1][0].codes}"


@checks("HOST-CAN-03", "good")
def wraps_are_no_loss_and_no_jump(e: HostCapture) -> str:
    """SEQ goes from 65535 to 0, TSTAMP every 0.262144 s: what is lost, and the times, about them."""
    row = limits("HOST-CAN-03")
    assert (row.limit("seq_modulo"), row.limit("tstamp_wrap_s")) == (SEQS, WRAP_US * 1e-6)
    m = e.samples()
    enough({0, SEQS - 1} <= {s.number for s, _ in m.pairs}, "the wrap of SEQ")
    e.count("lost", 0)
    return f"{len(m.pairs)} samples, none lost, times {_steady(e)}"


@checks("HOST-TIME-01", "delayed")
def times_are_those_of_the_conversions(e: HostCapture) -> str:
    """Frames come 30 ms late: the times told of their samples against the instants on the board."""
    m = e.samples()
    return f"{len(m.pairs)} samples, times {_steady(e)}"


def _steady(e: HostCapture) -> str:
    """Raises Failed when times told, from the first of each epoch on, are not those of the conversions."""
    tolerance_us = float(limits("HOST-TIME-01").limit("instant_tolerance_us"))
    worst_us = 0.0
    for epoch in sorted({p.epoch for _, p in e.match.pairs}):
        mine = [(s, p) for s, p in e.match.pairs if p.epoch == epoch]
        told_us = np.array([s.t_us for s, _ in mine])
        off_us = (told_us - told_us[0]) - np.array([p.t_us - mine[0][1].t_us for _, p in mine])
        k = int(np.argmax(np.abs(off_us)))
        worst_us = max(worst_us, abs(float(off_us[k])))
        if worst_us > tolerance_us:
            raise Failed(f"sample {mine[k][0].number} off by {off_us[k]:.0f} us", f"{tolerance_us:g} us at most")
    return f"right to {worst_us:.0f} us"


@checks("HOST-VALUE-01", "good")
def volts_are_codes_times_the_scale(e: HostCapture) -> str:
    """Volts told beside the codes."""
    row = limits("HOST-VALUE-01")
    told = [(s.codes, s.volts) for s in e.told.samples if s.volts is not None]
    if not told:
        raise Unseen('the host tells no volts ("v")')
    due = np.array([c[:3] for c, _ in told]) * float(row.limit("code_uv")) * 1e-6
    off = np.abs(np.array([v for _, v in told]) - due)
    if (off > np.abs(due) * float(row.limit("tolerance_ppm")) * 1e-6 + 1e-9).any():
        k = int(np.argmax(off.max(axis=1)))
        raise Failed(f"{told[k][1]} V", f"{tuple(float(v) for v in due[k])} V")
    return f"volts of {len(told)} samples"


# ---- asking the board


@checks("HOST-SETUP-02", "power_on")
def what_is_refused_during_the_set_up_is_asked_again(e: HostCapture) -> str:
    """Requests from power-on: the board rejects registers with 08000022h until its set-up is done."""
    refused = [f for f in e.bus.of(SDO_TX) if f.data[0] == ABORT]
    e.samples()
    for f in refused:
        again = [r for r in _requests(e) if r.t_s > f.t_s and r.data[1:4] == f.data[1:4]]
        expect(again, f"{_named(f)} was refused and never asked for again", "it is, until it is answered")
    _all_are_read(e)
    return f"{len(refused)} refusals, all registers read, {len(e.bus.samples)} samples"


@checks("HOST-SETUP-03", "power_on")
def the_stream_is_started_after_the_registers_are_known(e: HostCapture) -> str:
    """The order of the host's requests and of its NMT start."""
    expect(e.bus.starts, "no NMT start", "one, after identity and registers have been read")
    start_s = e.bus.starts[0]
    _all_are_read(e, before_s=start_s)
    named = any(_answered(e, index, None, start_s) for index in IDENTITY)
    saw = f"NMT start at {start_s:.6f} s, without an identity read before it"
    expect(named, saw, "1000h, 1008h or 1018h read before")
    return f"identity and {len(REGISTERS)} registers, then NMT start at {start_s:.3f} s"


@checks("HOST-CAN-10", "slow")
def nothing_is_asked_again_before_its_time(e: HostCapture) -> str:
    """Two answers come after 0.6 s: requests meanwhile."""
    timeout_s = float(limits("HOST-CAN-10").limit("timeout_s"))
    answers = e.bus.of(SDO_TX)
    slow = 0
    for before, after in zip(_requests(e), _requests(e)[1:], strict=False):
        answered_s = next((a.t_s for a in answers if a.t_s > before.t_s), float("inf"))
        slow += answered_s - before.t_s > 0.1
        asked_s = e.wall_s(before.t_s, after.t_s)
        if after.t_s < answered_s and asked_s < 0.95 * timeout_s:
            raise Failed(f"{_named(after)} asked {asked_s:.3f} s after {_named(before)}", "its answer, or 1 s")
    enough(slow, "an answer that took its time")
    e.samples()
    return f"{len(_requests(e))} requests, {slow} of them answered late"


def _requests(e: HostCapture) -> list[Frame]:
    return [f for f in e.bus.of(SDO_RX) if len(f.data) == 8]


def _named(f: Frame) -> str:
    return f"{number(f.data[1:3]):04X}h:{f.data[3]}"


def _answered(e: HostCapture, index: int, sub: int | None, before_s: float = float("inf")) -> bool:
    """Whether the board gave the object before that instant, and the host had asked for it."""
    return any(
        f.data[0] & 0xE0 == READ and number(f.data[1:3]) == index and sub in (None, f.data[3])
        for f in e.bus.of(SDO_TX)
        if f.t_s < before_s
    )


def _all_are_read(e: HostCapture, before_s: float = float("inf")) -> None:
    for index, sub in REGISTERS:
        if not _answered(e, index, sub, before_s):
            raise Failed(f"{index:04X}h:{sub} was not read", "it is, before the stream is started")


@checks("HOST-SETUP-01", "setup_order", "config0_x", "config0_z")
def a_wrong_set_up_is_told(e: HostCapture) -> str:
    """The set-up was carried out backwards, or a bit of CONFIG0 is wrong, in one converter alone."""
    expect(e.told.of("wrong_setup"), "the set-up was taken for the article's", '{"wrong_setup": ...}')
    expect(not e.told.samples, f"{len(e.told.samples)} samples told all the same", "none")
    return f"wrong set-up: {e.told.of('wrong_setup')[0]}"


# ---- what goes wrong with frames


@checks("HOST-LOST-01", "lost")
def lost_samples_are_counted(e: HostCapture) -> str:
    """1, 2 and 1000 samples do not come: the numbers told, each before the sample that follows the gap."""
    m = e.samples()
    seqs = [s.number for s, _ in m.pairs]
    gaps = {i: (b - a - 1) % SEQS for i, (a, b) in enumerate(itertools.pairwise(seqs), 1) if (b - a) % SEQS != 1}
    enough(len(gaps) == 3, "three gaps")
    if (told := e.told.by_place("lost")) != gaps:
        raise Failed(f"lost {_gaps(told)}", f"lost {_gaps(gaps)}")
    e.nothing_but("lost", "stale")
    return f"lost {_gaps(gaps)}"


def _gaps(found: dict[int, int]) -> str:
    return ", ".join(f"{n} after {at} samples" for at, n in found.items()) or "none"


@checks("HOST-CAN-02", "torn")
def a_half_without_the_other_is_torn(e: HostCapture) -> str:
    """Two second halves and a first one are lost."""
    e.samples()
    e.count("torn", 3)
    e.nothing_but("torn", "lost")
    return "torn: 3"


@checks("HOST-CAN-01", "mixed", "order")
def halves_of_two_samples_are_not_one(e: HostCapture) -> str:
    """Halves are missing so that what is left looks like a pair; or they come in another order."""
    e.samples()
    e.nothing_but("torn", "lost")
    return f"{len(e.match.pairs)} samples of halves that are their own, torn: {e.told.sum('torn')}"


@checks("HOST-CAN-01", "corrupt")
def a_wrong_bit_does_not_end_it(e: HostCapture) -> str:
    """A bit of four frames is wrong: the samples of the others."""
    hit = 4
    m = e.match
    few = len(m.strange) + len(m.missing) + len(m.wrong) <= 2 * hit
    saw = f"{len(m.missing)} samples not told, {len(m.strange)} that were not sent, of {len(e.bus.samples)}"
    expect(e.told.samples and few, saw, f"those of the {hit} frames at most")
    return f"{len(m.pairs)} of {len(e.bus.samples)} samples"


@checks("HOST-CAN-08", "twice")
def what_comes_twice_is_one_sample(e: HostCapture) -> str:
    """Halves of four samples come twice."""
    e.samples()
    e.count("lost", 0)
    e.nothing_but("torn")
    return f"{len(e.match.pairs)} samples, each once"


@checks("HOST-CAN-05", "length")
def a_message_of_the_wrong_length_is_torn(e: HostCapture) -> str:
    """A PSA2_XY of 7 bytes between two samples, twice."""
    e.samples()
    e.count("torn", 2)
    e.nothing_but("torn")
    return "torn: 2"


@checks("HOST-CAN-04", "others")
def other_nodes_and_error_frames_are_let_by(e: HostCapture) -> str:
    """Frames of node 6 between the halves of ours, two error frames, 1.4 ms off the bus."""
    e.samples()
    e.nothing_but("emcy")
    return f"{len(e.match.pairs)} samples"


@checks("HOST-RANGE-01", "over_range")
def each_axis_is_told_as_over_range(e: HostCapture) -> str:
    """X, Y, Z, up and down, at 9.9 V and beyond the range: what is reported, against the codes at their limits."""
    m = e.samples()
    due: list[tuple[str, str]] = []
    over = [False] * 3
    for _, p in m.pairs:
        for i, now in enumerate(p.limits):
            if now != over[i]:
                due.append(("over_range" if now else "in_range", "xyz"[i]))
                over[i] = now
    enough(len(due) >= 12, "each axis beyond its range twice")
    told = [(x.name, x.value) for x in e.told.events if x.name in ("over_range", "in_range")]
    if told != due:
        k = next((k for k, (a, b) in enumerate(zip(told, due, strict=False)) if a != b), min(len(told), len(due)))
        raise Failed(
            f"{_word(told, k)} as number {k + 1} of {len(told)}", f"{_word(due, k)} as number {k + 1} of {len(due)}"
        )
    e.nothing_but("over_range", "in_range", "frozen")
    return f"{len(due) // 2} times over the range and back"


def _word(words: list[tuple[str, str]], k: int) -> str:
    return " of ".join(words[k]) if k < len(words) else "nothing"


@checks("HOST-RST-01", "restart")
def a_restart_is_told_and_the_stream_goes_on(e: HostCapture) -> str:
    """A brown-out and a reset node of another master: boot-up messages, numbers from 0."""
    restarts = len([t for t in e.bus.boots if e.bus.starts and t > e.bus.starts[0]])
    enough(restarts, "a boot-up message")
    expect(len(e.told.of("restart")) == restarts, f"{len(e.told.of('restart'))} restarts", f"{restarts}")
    e.samples()
    epochs = {p.epoch for _, p in e.match.pairs}
    saw = f"samples of {len(epochs)} of {restarts + 1} lives of the board"
    expect(epochs == set(range(restarts + 1)), saw, "of all: NMT start after each boot-up")
    e.nothing_but("restart", "stale", "torn", "lost")
    return f"{restarts} restarts, samples after each"


@checks("HOST-SETTLE-01", "flags")
def samples_that_have_not_settled_are_not_told(e: HostCapture) -> str:
    """CONFIG1 is written: 63 words whose SETTLED is 0."""
    m = e.samples()
    enough(sum(not p.settled for p in e.bus.samples) > 10, "words that have not settled")
    none_of(m.unsettled, lambda s: f"{len(m.unsettled)} of them told, the first {s.number}", "none")
    return f"none of {sum(not p.settled for p in e.bus.samples)}"


@checks("HOST-OVER-01", "flags")
def conversions_that_the_board_lost_are_told(e: HostCapture) -> str:
    """Samples with OVERRUN."""
    due = sum(p.overrun for p in e.bus.samples)
    enough(due, "OVERRUN")
    e.count("overrun", due)
    return f"overrun: {due}"


@checks("HOST-STALE-01", "silence")
def silence_is_told_and_its_end(e: HostCapture) -> str:
    """40 ms without a frame, then 0.5 s."""
    e.samples()
    at = sum(p.arrived_s < e.marks["silent"] for _, p in e.match.pairs)
    told = [(x.value, x.at) for x in e.told.events if x.name == "stale"]
    if e.may_seem_silent:  # any other silence may have been real
        told = [t for t in told if t[1] == at]
    saw = ", ".join(f"stale {v} after {n} samples" for v, n in told) or "nothing"
    expect(told == [(True, at), (False, at)], saw, f"stale after {at} samples, and fresh before the next")
    return f"stale after {at} samples, fresh with the next"


@checks("HOST-STALE-02", "frozen")
def codes_that_stand_still_are_told(e: HostCapture) -> str:
    """The controller sends the same codes for two seconds."""
    e.samples()
    expect(e.told.of("frozen")[:1] == [True], "codes that stood still for 2 s were taken for data", '{"frozen": true}')
    expect(e.told.of("frozen") == [True, False], f"frozen {e.told.of('frozen')}", "frozen, and its end")
    first = next(
        i for i, (a, b) in enumerate(zip(e.bus.samples, e.bus.samples[1:], strict=False)) if a.codes[:3] == b.codes[:3]
    )
    after = e.told.places("frozen")[0] - first
    row = limits("HOST-STALE-02")
    least, most = (1000 * float(row.limit(name)) for name in ("told_min_s", "told_max_s"))
    if not least <= after <= most:
        raise Failed(f"frozen told after {after} samples of the same codes", f"after {least:.0f} to {most:.0f}")
    e.nothing_but("frozen")
    return f"frozen after {after} samples of the same codes"


@checks("HOST-RATE-01", "rate")
def a_data_rate_that_is_off_is_told(e: HostCapture) -> str:
    """The converters' clock 100 ppm off for a second, then 2000 ppm."""
    row = limits("HOST-RATE-01")
    e.samples()
    early = sum(p.arrived_s < e.marks["off"] for _, p in e.match.pairs)
    if wrong := [x for x in e.told.events if x.name == "rate_ppm" and x.at < early]:
        raise Failed(f"{wrong[0].value} ppm told at {row.limit('silent_ppm')} ppm", "nothing")
    told = e.told.of("rate_ppm")
    expect(told, f"nothing at {2 * row.limit('report_ppm')} ppm", '{"rate_ppm": ...}')
    e.nothing_but("rate_ppm")
    return f"{told[-1]} ppm"


@checks("HOST-CAN-06", "emcy")
def an_emergency_is_told_and_its_end(e: HostCapture) -> str:
    """Data-ready of X sticks for 0.4 s."""
    due = [number(f.data[0:2]) for f in e.bus.frames if f.can_id == 0x080 + e.bus.node and len(f.data) == 8]
    enough(len(due) >= 2, "an emergency and its end")
    expect(e.told.of("emcy") == due, f"{[f'{c:04X}h' for c in e.told.of('emcy')]}", f"{[f'{c:04X}h' for c in due]}")
    e.samples()
    return ", ".join(f"{c:04X}h" for c in due)


@checks("HOST-CAN-07", "off")
def a_unit_without_heartbeat_is_gone(e: HostCapture) -> str:
    """The supply is switched off; four heartbeats do not come."""
    e.samples()
    expect(e.told.of("gone") == [True], f"{len(e.told.of('gone'))} times gone", '{"gone": true} once')
    return "gone"


@checks("HOST-CAN-09", "fast")
def a_missing_toggle_is_a_lost_frame(e: HostCapture) -> str:
    """Frame form 1, which the host asks for: three frames do not come, each told by TOG alone."""
    words = [number(f.data) for f in e.bus.frames if f.can_id == FAST + e.bus.node and len(f.data) == 8]
    expect(e.streamed and words, f"no frame of form 1{e.last_words()}", "2020h = 1, then NMT start")
    gaps = sum(a >> TOG == b >> TOG for a, b in itertools.pairwise(words))
    enough(gaps == 3, "three gaps")
    due = [tuple(float(_signed21(w >> 21 * k)) for k in range(3)) for w in words]
    if (told := [r.values for r in e.told.readings]) != due:
        k = next((k for k, (a, b) in enumerate(zip(told, due, strict=False)) if a != b), min(len(told), len(due)))
        raise Failed(f"{told[k : k + 1]} as frame {k + 1} of {len(told)}", f"{due[k : k + 1]} of {len(due)}")
    e.count("lost", gaps)
    return f"{len(told)} frames, lost {gaps}"


def _signed21(bits: int) -> int:
    """A code of PSA2_FAST: code >> 3."""
    return ((bits & 0x1FFFFF) ^ 0x100000) - 0x100000
