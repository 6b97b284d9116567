"""Frames of a PSA-2 board on INT, DATA and CLK: four words, least significant bit first, taken on the rise of CLK.

INT falls when a frame begins and rises with its last bit; words are 4 CLK periods apart. Word width, bit order and word
order are options, because the article leaves them open and a board's profile settles them.
"""

from .pd import Decoder as Decoder
