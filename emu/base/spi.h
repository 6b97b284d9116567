/* Shift register of an SPI slave: bits to bytes and back, nothing of the chip behind it.
 *
 * A bus may drive it bit by bit (spi_sample on each sampling edge, then spi_miso for the next bit) or byte by byte
 * (spi_byte); both drive the same state and give the same bits. MSB first. The chip is given each byte when its last bit
 * has been sampled, and answers with the byte to shift out next. */
#ifndef PSABENCH_BASE_SPI_H
#define PSABENCH_BASE_SPI_H

#include <stdbool.h>
#include <stdint.h>

typedef uint8_t spi_byte_fn(void *chip, uint8_t mosi, int64_t t_ns);
typedef void spi_first_fn(void *chip, int64_t t_ns);

struct spi {
    spi_byte_fn *byte;
    spi_first_fn *first; /* called at the first falling edge of SCLK in each byte; may be NULL */
    void *chip;
    uint8_t out;  /* byte being shifted out */
    uint8_t in;   /* bits taken so far */
    uint8_t bits; /* 0..7 of them */
    uint8_t sent; /* the byte that the last eight MISO bits made up: what a master has read */
};

void spi_init(struct spi *s, spi_byte_fn *byte, spi_first_fn *first, void *chip);

/* Replaces the byte being shifted out, at whatever bit it is: a latch that updates mid-word tears just like this. */
void spi_load(struct spi *s, uint8_t out);

/* Level of the data output before the next sampling edge. */
bool spi_miso(const struct spi *s);

/* One sampling edge of SCLK. */
void spi_sample(struct spi *s, bool mosi, int64_t t_ns);

/* The first falling edge of SCLK of a byte (a data-ready line answers to it). Call it once a byte, at its own instant. */
void spi_first(struct spi *s, int64_t t_ns);

/* Eight sampling edges at once; t_ns is the last of them. Returns the byte shifted out meanwhile. */
uint8_t spi_byte(struct spi *s, uint8_t mosi, int64_t t_ns);

/* Forgets a partial byte: chip select high, interface time-out, reset. The output byte stays. */
void spi_realign(struct spi *s);

#endif
