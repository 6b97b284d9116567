"""sigrok sessions (.sr): a zip archive of `metadata` and of samples, `logic-1-1`, `logic-1-2` and so on.

Format: libsigrok's session file, version 2. Analog channels are left out.
"""

from __future__ import annotations

import configparser
import re
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from psabench.conform.sources.sampled import Sampler
from psabench.conform.sources.taken import BLOCK, MOST_BYTES, MOST_CHANNELS, Bounds, LineTake
from psabench.errors import BadInput, expected

MOST_METADATA = 1 << 16
MOST_MEMBERS = 100_000
MOST_RATIO = 1032  # of deflate; an archive that claims more has members that overlap
PLAIN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
UNITS = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
RATE = re.compile(r"\s*(\d{1,15}(?:\.\d{1,9})?)\s*([kKmMgG]?)(?:[hH][zZ])?\s*")


def read_sr(path: Path, bounds: Bounds) -> LineTake:
    """Raises BadInput for what is no session, or claims to be larger than any."""
    try:
        with zipfile.ZipFile(path) as archive:
            return _session(path, archive, bounds)
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError, ValueError, zlib.error) as e:
        raise BadInput(expected("a whole sigrok session", e, path)) from e


def _session(path: Path, archive: zipfile.ZipFile, bounds: Bounds) -> LineTake:
    members = archive.infolist()
    size = sum(m.file_size for m in members)
    if len(members) > MOST_MEMBERS or size > min(MOST_BYTES, MOST_RATIO * max(1, path.stat().st_size)):
        raise BadInput(
            expected(f"at most {MOST_MEMBERS} members, {MOST_BYTES} bytes", f"{len(members)}, {size} bytes", path)
        )
    if odd := [m.filename for m in members if m.compress_type not in PLAIN or m.flag_bits & 1]:
        raise BadInput(expected("members packed as sigrok does (stored or deflated)", repr(odd[0][:40]), path))
    by_name = {m.filename: m for m in members}
    if "metadata" not in by_name or by_name["metadata"].file_size > MOST_METADATA:
        raise BadInput(expected(f"metadata of {MOST_METADATA} bytes at most", "none or more", path))
    device = _device(path, archive.read("metadata").decode("utf-8", "replace"))
    names, bits = _probes(path, device)
    width = _number(path, device, "unitsize", 1, 8)
    sampler = Sampler(names, bits, bounds.line_hz or _rate(path, device), bounds.max_s)
    if max(bits) >= 8 * width:
        raise BadInput(expected(f"probes in {width} bytes", f"probe {max(bits) + 1}", f"{path}: metadata"))
    broken = _feed(archive, _chunks(path, by_name, device.get("capturefile", "logic-1")), width, sampler)
    if not sampler.samples:
        raise BadInput(expected("samples", f"none{broken and f' ({broken})'}", path))
    sampler.note = sampler.note or broken
    return sampler.take()


def _device(path: Path, text: str) -> Mapping[str, str]:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(text)
    except configparser.Error as e:
        raise BadInput(f"{path}: metadata: {str(e).splitlines()[0]}") from e
    with_probes = [s for s in parser.sections() if s.startswith("device") and "capturefile" in parser[s]]
    if not with_probes:
        raise BadInput(expected("a device with logic samples (capturefile)", "none", f"{path}: metadata"))
    return dict(parser[with_probes[0]])


def _number(path: Path, device: Mapping[str, str], key: str, least: int, most: int) -> int:
    text = device.get(key, "")
    if not (text.isascii() and text.isdigit() and len(text) < 6 and least <= int(text) <= most):
        raise BadInput(expected(f"{least} to {most}", repr(text[:20]), f"{path}: metadata: {key}"))
    return int(text)


def _probes(path: Path, device: Mapping[str, str]) -> tuple[list[str], list[int]]:
    total = _number(path, device, "total probes", 1, MOST_CHANNELS)
    found = [(device[f"probe{k}"].strip(), k - 1) for k in range(1, total + 1) if f"probe{k}" in device]
    if not found or len({n for n, _ in found}) != len(found):
        raise BadInput(expected("probes with names, each once", "none or one twice", f"{path}: metadata"))
    return [n for n, _ in found], [b for _, b in found]


def _rate(path: Path, device: Mapping[str, str]) -> float:
    text = device.get("samplerate", "")
    m = RATE.fullmatch(text)
    hz = float(m[1]) * UNITS[m[2].lower()] if m else 0.0
    if not 0.0 < hz <= 1e12:
        raise BadInput(expected("a sample rate, or --line-hz", repr(text[:20]), f"{path}: metadata: samplerate"))
    return hz


def _chunks(path: Path, by_name: Mapping[str, zipfile.ZipInfo], base: str) -> list[zipfile.ZipInfo]:
    """Members with samples in their order."""
    numbered = re.compile(re.escape(base) + r"-(\d{1,9})")
    parts = sorted((int(m[1]), name) for name in by_name if (m := numbered.fullmatch(name)))
    names = [n for _, n in parts] or [n for n in (base,) if n in by_name]
    if not names:
        raise BadInput(expected(f"a member {base} or {base}-1 with samples", "none", path))
    if parts and [k for k, _ in parts] != list(range(1, len(parts) + 1)):
        raise BadInput(expected(f"all members {base}-1, -2, ...", "gaps in their numbers", path))
    return [by_name[n] for n in names]


def _feed(archive: zipfile.ZipFile, parts: list[zipfile.ZipInfo], width: int, sampler: Sampler) -> str:
    """All samples; returns where they are damaged, "" where they are not."""
    rest = b""
    for part in parts:
        try:
            _check_sum(archive, part)
            with archive.open(part) as file:
                while not sampler.full and (data := file.read(BLOCK)):
                    rest = _feed_bytes(rest + data, width, sampler)
        except (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError) as e:
            return f"{part.filename} is damaged ({e}); the {sampler.samples} samples before it are judged"
    return f"{len(rest)} bytes too many at the end" if rest and not sampler.full else ""


def _check_sum(archive: zipfile.ZipFile, part: zipfile.ZipInfo) -> None:
    """Read to its end, where the sum is: of a member that is damaged no sample is sure. Raises as zipfile does."""
    with archive.open(part) as file:
        while file.read(BLOCK):
            pass


def _feed_bytes(data: bytes, width: int, sampler: Sampler) -> bytes:
    """Whole samples of them; returns the bytes left over."""
    whole = len(data) // width
    bytes_of = np.frombuffer(data, np.uint8, whole * width).reshape(whole, width)
    words = np.zeros((whole, 8), np.uint8)
    words[:, :width] = bytes_of
    sampler.feed(words.view("<u8")[:, 0].astype(np.uint64))
    return data[whole * width :]
