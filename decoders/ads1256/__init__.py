"""ADS1255 and ADS1256 above `spi` (mode 1, cpha=1): registers by name, opcodes, conversion words.

commands.py is that of `ads128x`, linked here: sigrok leaves a decoder out that another one has imported before.
"""

from .pd import Decoder as Decoder
