"""AD7710, AD7711 and AD7712 on their own pins: control register by fields, words, calibration coefficients.

The port is no SPI: RFS frames a read, TFS a write, SDATA serves both and A0 selects the register. Bits are taken on the
rises of SCLK, in external and in self-clocking mode. Several converters may share SCLK, SDATA, A0 and TFS: use one
decoder for each RFS. With TFS tied to A0 leave A0 out.
"""

from .pd import Decoder as Decoder
