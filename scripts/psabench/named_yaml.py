"""Settings in YAML: of a name that comes with the package, or of a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from psabench.errors import BadInput, expected, input_error
from psabench.places import proto_file


def read_yaml(path: Path, what: str) -> object:
    """The document. Raises BadInput with the file: `what` it should be."""
    import yaml

    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as e:
        raise input_error(path, f"{what} in YAML", e) from e


def read_named(name: str, known: Sequence[str], folder: str, option: str, what: str) -> tuple[object, Path]:
    """The document and its path: one of `known` in this folder of proto/, or a file. Raises BadInput."""
    path = proto_file(f"{folder}/{name}.yaml") if name in known else Path(name)
    if name not in known and not path.exists():
        raise BadInput(expected(f"{', '.join(known)}, or a file", f"{name}, no such file", option))
    return read_yaml(path, what), path


def checked_number(value: object, low: float, high: float, where: str) -> float:
    """Raises BadInput; true and false are no numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise BadInput(expected(f"{low:g} to {high:g}", value, where))
    return float(value)
