/* What the files of a PSD-1 board share. */
#ifndef PSABENCH_BOARD_PSD1_INTERNAL_H
#define PSABENCH_BOARD_PSD1_INTERNAL_H

#include "board/board.h"
#include "board/psd1/psd1.h"

#define PSD1_BIT(line)  TRACE_BIT(PSD1_LINE_##line)
#define PSD1_AB         (UINT64_C(0xF) << PSD1_LINE_AB0)
#define PSD1_D          (UINT64_C(0xFFFF) << PSD1_LINE_D0)
#define PSD1_BUS        (PSD1_BIT(CS) | PSD1_BIT(RW) | PSD1_AB | PSD1_D)
#define PSD1_HALF_NS    (PSD1_PERIOD_NS / 2)
#define PSD1_SCLK_NS    700 /* RFx fall to the first SCLK rise: article, section 4 */
#define PSD1_READ16_NS  13600
#define PSD1_FRAME24_NS 20000
#define PSD1_TIMEOUT_NS 100000000

/* ---- psd1/wave.c ---- */
void psd1_wave_init(struct psd1 *b);
void psd1_wave_power(struct psd1 *b, bool on, int64_t t_ns); /* 1M25 begins with its rise at t_ns, or ends */
void psd1_wave_catch_up(struct psd1 *b, int64_t t_ns);       /* reports what is known up to t_ns */
void psd1_frame_begin(struct psd1 *b, enum psd1_form form, uint32_t word, int64_t t_ns);
void psd1_frame_end(struct psd1 *b, int64_t t_ns); /* also of one that is cut */

/* Levels of lines from t_ns on, in order of time with what the wave brings by itself. */
static inline void psd1_put(struct psd1 *b, uint64_t lines, uint64_t level, int64_t t_ns)
{
    if (b->wave.on) psd1_wave_catch_up(b, t_ns);
    trace_put(&b->base.trace, lines, level, t_ns);
}

/* First edge of 1M25 strictly after t_ns: what moves at the very instant of an edge is seen by the next (E0). */
static inline int64_t psd1_next_rise(const struct psd1 *b, int64_t t_ns)
{
    const int64_t since_ns = t_ns - b->t0_ns;
    return t_ns + PSD1_PERIOD_NS - since_ns % PSD1_PERIOD_NS;
}

static inline int64_t psd1_next_fall(const struct psd1 *b, int64_t t_ns)
{
    const int64_t since_ns = t_ns - b->t0_ns + PSD1_HALF_NS;
    return t_ns + PSD1_PERIOD_NS - since_ns % PSD1_PERIOD_NS;
}

/* SCLK of a frame that begins at t_ns. */
static inline struct ad7712_sclk psd1_sclk(int64_t t_ns)
{
    return (struct ad7712_sclk){t_ns + PSD1_SCLK_NS, PSD1_PERIOD_NS, PSD1_HALF_NS};
}

/* ---- pins and events that all parts move ---- */
static inline void psd1_a0(struct psd1 *b, bool level, int64_t t_ns)
{
    psd1_put(b, PSD1_BIT(A0), level ? PSD1_BIT(A0) : 0, t_ns);
    for (unsigned i = 0; i < 3; i++) ad7712_a0_pin(&b->adc[i], level, t_ns);
}

static inline void psd1_rf(struct psd1 *b, unsigned axis, bool level, int64_t t_ns)
{
    const uint64_t line = PSD1_BIT(RFX) << axis;
    psd1_put(b, line, level ? line : 0, t_ns);
    ad7712_rfs_pin(&b->adc[axis], level, t_ns);
}

/* The next event of the controller; inside a step it is scheduled by the controller. */
static inline void psd1_due(struct psd1 *b, enum psd1_phase phase, int64_t t_ns)
{
    b->phase = phase;
    b->due_ns = t_ns;
    if (b->stepping) return;
    if (t_ns == SCHED_NEVER) sched_cancel(b->base.sched, &b->ev);
    else sched_at(b->base.sched, &b->ev, t_ns);
}

/* A fault if DR does not fall in time. */
static inline void psd1_arm_timeout(struct psd1 *b, int64_t t_ns)
{
    b->timeout_ns = t_ns + PSD1_TIMEOUT_NS + 12 * ad7712_period_ns(&b->adc[0]);
    if (!b->timeout.queued || b->timeout.due_ns > b->timeout_ns) sched_at(b->base.sched, &b->timeout, b->timeout_ns);
}

/* ---- steps: at the instant of the phase; the next one's is returned, the phase set ---- */
typedef int64_t psd1_step(struct psd1 *b, int64_t t_ns);
psd1_step psd1_cycle_start, psd1_rf_fall, psd1_rf_rise, psd1_clear; /* psd1/cycle.c */
psd1_step psd1_host_strobe, psd1_host_end;                          /* psd1/bus.c, of the built-in host */
psd1_step psd1_tfs_fall, psd1_tfs_rise, psd1_await_dr, psd1_coef_a0, psd1_coef_fall, psd1_coef_rise; /* psd1/job.c */
psd1_step psd1_job_next; /* begins the operation that is due */

/* ---- psd1/cycle.c ---- */
/* From A0 on; one that is only due has not begun. */
static inline bool psd1_in_cycle(const struct psd1 *b)
{
    return b->phase >= PSD1_RF_FALL && b->phase <= PSD1_CLEAR;
}

uint32_t psd1_lost(struct psd1 *b);          /* counts what was lost so far into the counters; the sum */
void psd1_cut(struct psd1 *b, int64_t t_ns); /* the cycle ends here */

/* ---- psd1/job.c ---- */
void psd1_job_init(struct psd1 *b);
enum board_cycle_result psd1_request_check(const struct psd1 *b, uint8_t command, uint32_t word, const char **why);
void psd1_job_setup(struct psd1 *b); /* the row of the set-up; its first step is due */
void psd1_job_stop(struct psd1 *b, enum board_cycle_result result, int64_t t_ns);
void psd1_job_timeout(struct psd1 *b, int64_t t_ns);   /* no DR for too long */
void psd1_job_dr(struct psd1 *b, int64_t t_ns);        /* DR has fallen */
void psd1_try_start(struct psd1 *b, int64_t t_ns);     /* idle: a command or a cycle, if its conditions are met */
void psd1_recheck_start(struct psd1 *b, int64_t t_ns); /* one of the conditions has changed */

/* ---- psd1/bus.c ---- */
void psd1_bus_init(struct psd1 *b);
void psd1_bus_stop(struct psd1 *b, int64_t t_ns);

/* ---- psd1/aux.c ---- */
void psd1_aux_init(struct psd1 *b);
void psd1_aux_power_up(struct psd1 *b, int64_t t_ns);
void psd1_aux_latch(struct psd1 *b, struct psd1_cycle *c, int64_t t_ns); /* gyros and rate sensors */
void psd1_aux_until(struct psd1 *b, int64_t t_ns);
uint16_t psd1_aux_temp(const struct psd1 *b, int64_t t_ns);
uint16_t psd1_aux_service(const struct psd1 *b, int64_t t_ns);

#endif
