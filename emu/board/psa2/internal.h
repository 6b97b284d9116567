/* What the files of the PSA-2 board share: serial port, temperature scan, requests, output line, and the controller that
 * calls them. Not for others. */
#ifndef PSABENCH_BOARD_PSA2_INTERNAL_H
#define PSABENCH_BOARD_PSA2_INTERNAL_H

#include "board/psa2/psa2.h"

#define PSA2_TIMEOUT_NS INT64_C(100000000) /* E0: 100 ms beyond the settling time without data-ready is a fault */

/* A line that follows the controller or a converter: without power all are low. */
static inline void psa2_line(struct psa2 *b, enum psa2_line line, bool level, int64_t t_ns)
{
    trace_set(&b->base.trace, line, level && b->mode != PSA2_OFF, t_ns);
}

/* psa2/port.c */
void psa2_port_init(struct psa2 *b);
void psa2_pulse_stop(struct psa2 *b, int64_t t_ns);
/* Whether span_ns from now on end before the next DRD_A, or no period is long enough for them, or no data come. */
bool psa2_window(const struct psa2 *b, int64_t span_ns, int64_t t_ns);
bool psa2_in_time(const struct psa2 *b, int64_t drd_a_ns, int64_t end_ns); /* before the next DRD_A, and its margin */
bool psa2_fits(const struct psa2 *b, int64_t span_ns);                     /* a period is long enough for them */
int64_t psa2_sync_t_ns(const struct psa2 *b, int64_t t_ns);      /* a pulse on SYNC_T that is asked for now is over */
bool psa2_flowing(const struct psa2 *b, int64_t t_ns);           /* DRD_A came within the last two periods */
int64_t psa2_timeout_ns(const struct psa2 *b, int64_t drd_a_ns); /* it is a fault if the next has not come by then */
void psa2_arm_timeout(struct psa2 *b, int64_t t_ns);
void psa2_pulse(struct psa2 *b, enum psa2_group group, void (*done)(struct psa2 *b, int64_t t_ns), int64_t t_ns);

/* psa2/spi.c */
void psa2_spi_init(struct psa2 *b);
void psa2_spi_stop(struct psa2 *b, int64_t t_ns); /* the lines fall idle in the middle of whatever they carried */
bool psa2_spi_busy(const struct psa2 *b);
int32_t psa2_tclk_ns(const struct psa2 *b, int32_t periods); /* of the accelerometer converters' clock, rounded up */
int32_t psa2_tau_ns(const struct psa2 *b, int32_t periods);  /* of the temperature converter's clock */
void psa2_spi_start(struct psa2 *b, const struct psa2_xfer *x, int64_t t_ns);
int64_t psa2_spi_span_ns(const struct psa2 *b, const struct psa2_spi_past *past, const struct psa2_xfer *x,
                         int64_t t_ns); /* an upper bound */
/* When psa2_spi_start() would be done: the instants alone, from a past that moves on. */
int64_t psa2_spi_pass(const struct psa2 *b, struct psa2_spi_past *past, const struct psa2_xfer *x, int64_t t_ns);
struct psa2_xfer psa2_xfer_accel(const struct psa2 *b, const uint8_t *tx, unsigned count); /* gaps of 24 tCLK */
struct psa2_xfer psa2_xfer_temp(const struct psa2 *b, const uint8_t *tx, unsigned count); /* gap of 24 tau at the end */

/* psa2/temp.c */
void psa2_temp_restart(struct psa2 *b);                 /* channel 0, after Res */
bool psa2_temp_start(struct psa2 *b, int64_t t_ns);     /* starts the transfer that is due, if any */
void psa2_temp_await(struct psa2 *b, int64_t t_ns);     /* DRD_T is to fall: a fault if it does not */
void psa2_temp_answered(struct psa2 *b);                /* it did */
void psa2_temp_ready(struct psa2 *b);                   /* DRD_T fell while the scan runs */
void psa2_temp_timeout(struct psa2 *b, int64_t t_ns);   /* it did not */
void psa2_temp_disturbed(struct psa2 *b, int64_t t_ns); /* a request changed the converter */
bool psa2_temp_free(const struct psa2 *b); /* the converter has answered and is not converting for the scan */
struct psa2_xfer psa2_temp_write_mux(const struct psa2 *b, unsigned channel);
struct psa2_xfer psa2_temp_read_data(const struct psa2 *b);
uint8_t psa2_temp_mux(unsigned channel);
double psa2_temp_v(const struct psa2 *b, double temp_degc); /* at the input of the converter */
double psa2_temp_ain_v(void *ctx, unsigned ain, int64_t t_ns);

/* psa2/temp_cycle.c: where the scan repeats itself. */
void psa2_cycle_begin(struct psa2 *b);                            /* nothing is known of it */
void psa2_cycle_note(struct psa2_cycle *c, struct psa2_start at); /* the next conversion in a row */
void psa2_cycle_break(struct psa2_cycle *c);                      /* the next one noted begins a row */
/* From the conversion that begins at at->tau to the last that begins by until_ns: how many were passed. 0: none, or it is not
 * of the cycle. */
uint32_t psa2_cycle_pass(const struct psa2_cycle *c, struct psa2_start *at, int64_t until_ns);

/* psa2/temp_skip.c */
/* Conversions that no one looks at before until_ns, from where on codes are true; lazy.again is due before the last one's word. */
void psa2_temp_skip(struct psa2 *b, int64_t until_ns);

/* psa2/request.c */
enum psa2_result psa2_request_accept(struct psa2 *b, struct psa2_request *r); /* PSA2_OK: it is due */
bool psa2_request_start(struct psa2 *b, int64_t t_ns);
void psa2_request_fail(struct psa2 *b, enum psa2_group group, bool all, int64_t t_ns); /* PSA2_TIMEOUT */

/* psa2/lazy.c */
void psa2_lazy_frame(struct psa2 *b,
                     int64_t t_ns); /* a frame has ended: the board may fall asleep, skip frames, wake up */
void psa2_lazy_sleep(
    struct psa2 *b); /* between two frames it has done something else: if it sleeps, it may skip frames */
void psa2_lazy_init(struct psa2 *b);
void psa2_lazy_change(struct psa2 *b, int64_t t_ns); /* the world is about to change abruptly, perhaps back to normal */
void psa2_lazy_stop(struct psa2 *b);                 /* a reset: nothing to be awake for */
const char *psa2_why_eager(struct psa2 *b, int64_t t_ns); /* NULL: what no one looks at need not be computed */

/* psa2/frame.c */
void psa2_out_init(struct psa2 *b);
void psa2_out_stop(struct psa2 *b, int64_t t_ns);
void psa2_out_wake(struct psa2 *b, int64_t t_ns);  /* an observer subscribes during a frame */
void psa2_out_start(struct psa2 *b, int64_t t_ns); /* sends b->latest; dropped and counted if INT is low */

/* ---- UREF: psa2/uref.c ---- */

#define PSA2_UREF_LEAST 0.01 /* of UREF, whatever the supply does: codes are at their limit then */

bool psa2_uref_moves(const struct psa2 *b);
double psa2_uref_ratio(const struct psa2_profile *p, double supply_ratio); /* UREF to its nominal value */
void psa2_uref_row(const struct psa2 *b, double *vin_v, const struct looks *at);

#endif
