/* РК, the 24-bit shift register of the controller KPSD-1, between the bus D0..D15 and the line SDAT (article, section 4).
 *
 * It works in four modes: a 16-bit word in from SDAT, that word out to the bus, a 24-bit control word in from the bus (two
 * cycles: 8 upper, 16 lower bits), and that word out to SDAT. Bits travel highest first. Pure. */
#ifndef PSABENCH_BOARD_PSD1_SHIFT_H
#define PSABENCH_BOARD_PSD1_SHIFT_H

#include <stdbool.h>
#include <stdint.h>

#define PSD1_RK_BITS 24u

enum psd1_rk_mode { PSD1_RK_IN, PSD1_RK_TO_BUS, PSD1_RK_FROM_BUS, PSD1_RK_OUT };

struct psd1_rk {
    enum psd1_rk_mode mode;
    uint32_t bits; /* 24 */
};

/* A bit from SDAT, at a rise of SCLK. */
static inline void psd1_rk_take(struct psd1_rk *r, bool bit)
{
    r->mode = PSD1_RK_IN;
    r->bits = (r->bits << 1 | bit) & 0xFFFFFF;
}

/* n bits at once, with the same result. */
static inline void psd1_rk_take_word(struct psd1_rk *r, uint32_t word, unsigned n)
{
    r->mode = PSD1_RK_IN;
    r->bits = (r->bits << n | word) & 0xFFFFFF;
}

/* The word on D0..D15. */
static inline uint16_t psd1_rk_bus(struct psd1_rk *r)
{
    r->mode = PSD1_RK_TO_BUS;
    return (uint16_t)r->bits;
}

/* A control word from the bus. */
static inline void psd1_rk_load(struct psd1_rk *r, uint8_t high, uint16_t low)
{
    r->mode = PSD1_RK_FROM_BUS;
    r->bits = (uint32_t)high << 16 | low;
}

/* The bit on SDAT, then the shift at a fall of SCLK; what has left comes in again behind, so that the word is kept. */
static inline bool psd1_rk_give(struct psd1_rk *r)
{
    const bool bit = r->bits >> 23 & 1;
    r->mode = PSD1_RK_OUT;
    r->bits = (r->bits << 1 | bit) & 0xFFFFFF;
    return bit;
}

/* All 24 bits at once, with the same result. */
static inline uint32_t psd1_rk_give_word(struct psd1_rk *r)
{
    r->mode = PSD1_RK_OUT;
    return r->bits;
}

#endif
