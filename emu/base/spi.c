#include "base/spi.h"

void spi_init(struct spi *s, spi_byte_fn *byte, spi_first_fn *first, void *chip)
{
    *s = (struct spi){.byte = byte, .first = first, .chip = chip};
}

void spi_load(struct spi *s, uint8_t out)
{
    s->out = out;
}

bool spi_miso(const struct spi *s)
{
    return (s->out >> (7 - s->bits)) & 1;
}

void spi_sample(struct spi *s, bool mosi, int64_t t_ns)
{
    s->sent = (uint8_t)((s->sent << 1) | spi_miso(s));
    s->in = (uint8_t)((s->in << 1) | mosi);
    if (++s->bits < 8) return;
    s->bits = 0;
    s->out = s->byte(s->chip, s->in, t_ns);
}

void spi_first(struct spi *s, int64_t t_ns)
{
    if (s->first) s->first(s->chip, t_ns);
}

uint8_t spi_byte(struct spi *s, uint8_t mosi, int64_t t_ns)
{
    if (s->bits) { /* not aligned: the byte straddles two of the slave's */
        for (int b = 7; b >= 0; b--) spi_sample(s, (mosi >> b) & 1, t_ns);
        return s->sent;
    }
    s->sent = s->out;
    s->in = mosi;
    s->out = s->byte(s->chip, mosi, t_ns);
    return s->sent;
}

void spi_realign(struct spi *s)
{
    s->bits = 0;
}
