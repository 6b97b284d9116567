"""The inertial unit asked over CAN."""

from __future__ import annotations

from psabench.boards.bins.conform.stimulus import until_ready
from psabench.boards.objects import BinsObjects as OD
from psabench.conform.dictionary import as_the_dictionary_says, identity
from psabench.conform.dut import Dut
from psabench.conform.plan import active


@active("BINS-CAN-04", needs={"can"}, before=until_ready)
def objects_are_as_the_dictionary_says(s: Dut) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    return as_the_dictionary_says(s, "bins", varies=(OD.WEIGHTS, OD.TIMING))


@active("BINS-CAN-05", needs={"can"})
def the_board_says_what_it_is(s: Dut) -> str:
    """Read 1008h and 1018h sub 2."""
    return identity(s, "BINS-CAN-05", "BINS")
