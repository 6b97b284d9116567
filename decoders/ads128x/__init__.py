"""ADS1281 and ADS1282 above `spi` (mode 0): registers by name, opcodes, conversion words.

These parts have no chip select, so a conversion word is known by its shape: an unbroken burst of as many
zero bytes on DIN as a word has. On a PSA-2 board SClk is shared with the temperature converter: give `spi` the line CST
with cs_polarity=active-high, and only what is meant for the accelerometer converters is decoded.
"""

from .pd import Decoder as Decoder
