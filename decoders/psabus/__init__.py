"""Cycles on the 16-bit parallel bus of a PSD-1, PMKA or PIK board: read or write, address, word.

A cycle lasts while CS is low. The word of a read is on the bus when the strobe begins, that of a write acts at its
end: both are taken at the beginning, where the boards put them.
"""

from .pd import Decoder as Decoder
