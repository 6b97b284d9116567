"""`python -m psabench`: the command, for who has no script folder in PATH."""

import sys

from psabench.cli import main

sys.exit(main())
