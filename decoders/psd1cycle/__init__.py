"""Cycles of reading on the lines of a PSD-1 board: three words of 16 bits, most significant bit first.

Each word is taken on the rises of SCLK while RFX, RFY or RFZ is low and is offered to the host while FL2 is high, which
reads it at address 0, 1 or 2. A cycle lasts from the rise of A0 to its fall. What breaks a limit of the AD7712 or comes
in the wrong order is a warning.
"""

from .pd import Decoder as Decoder
