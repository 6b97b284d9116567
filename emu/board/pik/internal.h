/* What the files of the board share. Not for others. */
#ifndef PSABENCH_BOARD_PIK_INTERNAL_H
#define PSABENCH_BOARD_PIK_INTERNAL_H

#include "board/pik/pik.h"

#define PIK_PULSE_LINES (UINT64_C(0x3F) << PIK_LINE_FXP)

static inline int64_t pik_tick_at(const struct pik *b, int64_t t_ns) /* the last at or before */
{
    return b->first_tick + clk_count_at(&b->clk, t_ns + 1) - 1;
}

static inline int64_t pik_tick_ns(const struct pik *b, int64_t tick)
{
    return clk_edge_ns(&b->clk, tick - b->first_tick);
}

/* pik/sample.c; pik_sample_until() */
uint64_t pik_count_plus(const struct pik_channel *c); /* as the counter has it */
uint64_t pik_count_minus(const struct pik_channel *c);

/* pik/specimen.c */
struct pik_specimen pik_specimen_draw(const struct pik_profile *p, uint64_t seed, uint32_t serial);
int64_t pik_tick_hz(const struct pik *b);  /* thousandths of it, with all that the generator is off by */
void pik_warm(struct pik *b, double degc); /* what holds of each channel at this temperature */

/* pik/lines.c */
void pik_lines_init(struct pik *b);
void pik_lines_rest(struct pik *b, bool power, int64_t t_ns);
void pik_lines_pulse(struct pik *b, unsigned axis,
                     int64_t from_ns); /* the one that has begun last, seen from then on */
void pik_lines_stuck(struct pik *b, unsigned axis, int64_t t_ns);
void pik_lines_clock(struct pik *b, int64_t t_ns); /* CLK up to now: its pace will change */

/* pik/latch.c */
void pik_latch_init(struct pik *b);
void pik_latch_restart(struct pik *b, int64_t t_ns);
void pik_latch_now(struct pik *b, int64_t t_ns);
void pik_set_period(struct pik *b, unsigned period_100us, int64_t t_ns);
bool pik_period_fits(const struct pik *b, unsigned period_100us);
void pik_period_range(const struct pik *b, unsigned *least, unsigned *most); /* of those that fit, beside 0 */

/* pik/bus.c */
void pik_bus_init(struct pik *b);
void pik_bus_cut(struct pik *b, int64_t t_ns); /* the cycle under way, if any */

#endif
