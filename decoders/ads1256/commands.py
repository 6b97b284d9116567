"""Register commands: those of `ads128x`, whose file must lie in the folder beside this one.

Run from the file, not imported: sigrok leaves a decoder out that another one has imported before. No link either: zip
files, copies and some checkouts make a text file of it.
"""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

_spec = spec_from_file_location(f"{__package__}.shared", Path(__file__).parents[1] / "ads128x/commands.py")
_shared = module_from_spec(_spec)
_spec.loader.exec_module(_shared)

Commands, Register = _shared.Commands, _shared.Register
