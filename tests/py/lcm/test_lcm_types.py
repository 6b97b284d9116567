"""The types of proto/lcm beside the code that lcm-gen makes of them, and bytes that are no message."""

from __future__ import annotations

import importlib
import math
import random
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from psabench.errors import BadInput
from psabench.lcm.types import LcmType, lcm_type, parse, type_names, type_of

ROOT = Path(__file__).resolve().parents[3]
FILES = sorted((ROOT / "proto/lcm").glob("*.lcm"))
NAMES = pytest.mark.parametrize("name", type_names())
RANGES = {"int8_t": 7, "int16_t": 15, "int32_t": 31, "int64_t": 63}


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mapping[str, Any]]:
    """The classes of lcm-gen -p, Debian's or that of the `lcm` package."""
    folder = tmp_path_factory.mktemp("gen")
    lcm_gen = shutil.which("lcm-gen") or str(Path(sys.executable).with_name("lcm-gen"))
    subprocess.run([lcm_gen, "-p", "--ppath", str(folder), *map(str, FILES)], check=True)
    sys.path.insert(0, str(folder))
    try:
        yield {name: getattr(importlib.import_module(f"psabench_lcm.{name}"), name) for name in type_names()}
    finally:
        sys.path.remove(str(folder))


def random_values(kind: LcmType, rng: random.Random) -> dict[str, Any]:
    """Fields with values of their whole ranges."""
    values: dict[str, Any] = {}

    def one(what: str) -> Any:
        if what == "string":
            return "".join(rng.choices("aZ_09 é", k=rng.randrange(20)))
        if what == "boolean":
            return rng.random() < 0.5
        if what == "double":
            return rng.choice([0.0, -1.5, 1e300, rng.uniform(-10, 10), math.inf])
        return rng.randrange(-(1 << RANGES[what]), 1 << RANGES[what])

    counts = {m.size for m in kind.members if m.size and not m.size.isdecimal()}
    for m in kind.members:
        if m.name in counts:
            values[m.name] = rng.randrange(9)
            continue
        count = int(m.size if m.size.isdecimal() else values.get(m.size, 0))
        if m.kind == "byte":
            values[m.name] = rng.randbytes(count)
        else:
            values[m.name] = one(m.kind) if not m.size else tuple(one(m.kind) for _ in range(count))
    return values


def test_every_file_is_a_type_and_every_type_a_file() -> None:
    assert all(parse(f.read_text(), f).name == f.stem for f in FILES)
    assert len({lcm_type(name).fingerprint for name in type_names()}) == len(type_names())


@NAMES
def test_fingerprints_and_bytes_are_those_of_lcm_gen(name: str, generated: Mapping[str, Any]) -> None:
    rng = random.Random(name)
    kind = lcm_type(name)
    assert generated[name]._get_packed_fingerprint() == kind.fingerprint
    for _ in range(50):
        values = random_values(kind, rng)
        message = generated[name]()
        for field, value in values.items():
            setattr(message, field, value)
        data = message.encode()
        assert kind.encode(values) == data
        assert kind.decode(data) == values
        assert type_of(data) is kind


@NAMES
def test_each_field_of_a_physical_quantity_has_its_unit_and_each_type_its_time_base(name: str) -> None:
    """Doubles end in a unit, but for those of a result, which have theirs beside them."""
    units = ("_v", "_s", "_degc", "_deg", "_dps", "_radps", "_mps2", "_a")
    for m in lcm_type(name).members:
        if m.kind == "double" and name != "result_t":
            assert m.name.endswith(units), f"{name}.{m.name}"
    first = [m.name for m in lcm_type(name).members][:2]
    assert first == ["t_ns", "epoch_ns"] or first[0] == "host_ns"


@NAMES
def test_cut_and_changed_messages_are_refused_or_decoded_and_nothing_else(name: str) -> None:
    """Each length, then single bytes changed: a ValueError or fields, in bounded time."""
    rng = random.Random(name)
    kind = lcm_type(name)
    data = kind.encode(random_values(kind, rng))
    for size in range(len(data)):
        with pytest.raises(ValueError, match=r"expected "):
            kind.decode(data[:size])
    with pytest.raises(ValueError, match=r"expected \d+ bytes"):
        kind.decode(data + b"\0")
    for _ in range(500):
        changed = bytearray(data)
        changed[rng.randrange(8, len(data))] = rng.randrange(256)
        try:
            kind.decode(bytes(changed))
        except ValueError as e:
            assert "expected " in str(e)  # noqa: PT017 (either way is right)


@pytest.mark.parametrize("count", [-1, 3, 1 << 30, (1 << 31) - 1])
@pytest.mark.parametrize(("name", "field"), [("can_frame_t", "size"), ("result_t", "count")])
def test_a_count_is_not_believed(name: str, field: str, count: int) -> None:
    """A gigabyte that is announced is not made room for."""
    kind = lcm_type(name)
    values = random_values(kind, random.Random(1)) | {field: 2}
    arrays = {m.name: m.kind for m in kind.members if m.size == field}
    values |= {a: b"ab" if k == "byte" else ("x", "y") if k == "string" else (1.0, 2.0) for a, k in arrays.items()}
    data = kind.encode(values)
    at = data.index(struct.pack(">i", 2), 30)
    with pytest.raises(ValueError, match=r"expected "):
        kind.decode(data[:at] + struct.pack(">i", count) + data[at + 4 :])


def test_a_count_below_zero_is_refused_even_where_nothing_follows() -> None:
    kind = parse("package a; struct b { int32_t n; string s[n]; }")
    with pytest.raises(ValueError, match=r"b.s: expected 0 texts or more, got -1"):
        kind.decode(kind.fingerprint + struct.pack(">i", -1))
    assert kind.decode(kind.fingerprint + struct.pack(">i", 0)) == {"n": 0, "s": ()}


@pytest.mark.parametrize(
    ("values", "words"),
    [({"id": 1 << 31}, "can_frame_t.id: expected int32_t"), ({"bus": 5}, "bus"), ({"size": 3}, "expected 3 elements")],
)
def test_a_value_that_does_not_fit_is_named(values: Mapping[str, Any], words: str) -> None:
    kind = lcm_type("can_frame_t")
    good = random_values(kind, random.Random(2)) | {"size": 2, "data": b"ab"}
    with pytest.raises(ValueError, match=words):
        kind.encode(good | dict(values))
    with pytest.raises(ValueError, match=r"can_frame_t.bus: expected string"):
        kind.encode({k: v for k, v in good.items() if k != "bus"})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a package and one struct"),
        ("package a; struct b { int32_t x; } struct c { int32_t y; }", "a package and one struct"),
        ("package a; struct b { other_t x; }", "x: expected one of boolean"),
        ("package a; struct b { int32_t x[n]; }", "a number or an earlier integer field, got n"),
        ("package a; struct b { int32_t x[2][2]; }", "fields as"),
        ("package a; struct b { const int32_t X = 1; }", "fields as"),
    ],
)
def test_what_is_no_type_is_refused(text: str, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        parse(text)
