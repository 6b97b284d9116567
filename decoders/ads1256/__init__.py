"""ADS1255 and ADS1256 above `spi` (mode 1, cpha=1): registers by name, opcodes, conversion words.

What it shares with `ads128x` is read from the folder beside this one.
"""

from .pd import Decoder as Decoder
