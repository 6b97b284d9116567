#!/usr/bin/env python3
"""Everything that follows from proto/psabench.yaml and proto/<board>.yaml, the source of CAN messages and objects.

Usage:
    gen_proto.py            write what is kept in git: proto/psabench.dbc, boards/objects.py and parameters.py, an EDS
                            and a page a device, the tables of docs/tools/uds.md
    gen_proto.py --check    exit 1 and name the ones that are out of date
    gen_proto.py --out DIR  write the C tables: psabench_can.[ch] (cantools), an <device>_od.[ch] each,
                            parameter_names.[ch], uds_dids.[ch]

psabench.yaml is PSA-2 and what all devices have in common: network management, services, communication objects.
unit.yaml has the objects that the others share, and its head the grammar of their files. uds.yaml has data identifiers.
"""

import argparse
import sys
from pathlib import Path

from protogen.c_tables import c_files
from protogen.dbc import dbc
from protogen.eds import eds
from protogen.model import ROOT, Protocol
from protogen.objects import objects_module
from protogen.page import page
from protogen.parameters import parameter_files, parameters_module
from protogen.source import load_all
from protogen.uds import PAGE as UDS_PAGE
from protogen.uds import uds_files, uds_page


def kept_files(protocols: list[Protocol]) -> dict[Path, str]:
    """Path to text of everything that is kept in git."""
    files = {
        ROOT / "proto/psabench.dbc": dbc(protocols),
        ROOT / "scripts/psabench/boards/objects.py": objects_module(protocols),
        ROOT / "scripts/psabench/boards/parameters.py": parameters_module(protocols),
        UDS_PAGE: uds_page(protocols),
    }
    for p in protocols:
        files[ROOT / f"proto/{p.key}.eds"] = eds(p)
        name = "protocol.md" if p.key == "psa2" else f"protocol_{p.key}.md"
        files[ROOT / "docs/reference" / name] = page(p)
    return files


def write(path: Path, text: str) -> None:
    """Write only what changes, so that nothing is compiled again for nothing."""
    if not path.exists() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def main(argv: list[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--out", type=Path, metavar="DIR", help="write the C tables there")
    parser.add_argument("--check", action="store_true", help="exit 1 if a file kept in git is out of date")
    args = parser.parse_args(argv)
    protocols = load_all()
    if args.check:
        kept = kept_files(protocols).items()
        old = [str(f.relative_to(ROOT)) for f, text in kept if not f.exists() or f.read_text() != text]
        if old:
            print(f"out of date: {', '.join(old)}; run tools/gen_proto.py", file=sys.stderr)
        return 1 if old else 0
    compiled = c_files(protocols) | parameter_files(protocols) | uds_files(protocols)
    files = {args.out / name: text for name, text in compiled.items()} if args.out else kept_files(protocols)
    for path, text in files.items():
        write(path, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
