/* What the files of psa2_can share: psa2/can.c (life, serial port), psa2/can_od.c (objects), psa2/can_stream.c (frames
 * to PDOs), psa2/can_fit.c (whether the bus can carry them). Not for others. */
#ifndef PSABENCH_BOARD_PSA2_CAN_INTERNAL_H
#define PSABENCH_BOARD_PSA2_CAN_INTERNAL_H

#include "board/psa2/can.h"

enum psa2_sample_mode { PSA2_FREE_RUN, PSA2_ON_SYNC, PSA2_EVERY_NTH };

struct psa2_can_info psa2_can_info(const struct psa2_can *c);

/* Object access, as in co_node_io. */
uint32_t psa2_can_read(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns);
uint32_t psa2_can_write(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns);
void psa2_can_defaults(struct psa2_can *c);

/* Hands a request of the SDO server to the board; axis: whose answer is requested. CO_PENDING, or why not. */
uint32_t psa2_can_submit(struct psa2_can *c, enum psa2_group group, enum psa2_op op, uint8_t addr, uint8_t value,
                         unsigned axis, int64_t t_ns);

/* Whether the bus can carry these settings at a data period (0: unknown, not judged); if not, the reason is in why. */
bool psa2_can_fit(const struct can_bus_cfg *bus, const struct psa2_can_settings *set, int64_t period_ns,
                  char why[PSA2_CAN_TEXT]);

/* Data period that a value of CONFIG0 gives; 0: a value that the board will refuse itself. */
int64_t psa2_can_config0_period_ns(uint32_t fclk_hz, uint8_t config0);

/* As psa2_can_fit(), with EMCY and the text of 2031h: begun where it does not fit, ended where it does. */
bool psa2_can_judge(struct psa2_can *c, const struct psa2_can_settings *set, int64_t period_ns, int64_t t_ns);

/* Judges what is set now, with the present data period, and lets the stream flow or stand; tells only changes. */
void psa2_can_rejudge(struct psa2_can *c, int64_t t_ns);

/* Forgets a block half filled and feeds the PDOs of the present form. */
void psa2_can_stream_restart(struct psa2_can *c);

#endif
