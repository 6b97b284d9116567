/* What moves the time of a bench, and which pins it reports. Included by api/internal.h, whose structs it takes. */
#ifndef PSABENCH_API_RUN_H
#define PSABENCH_API_RUN_H

#include "api/internal.h"

/* Whether time may move now; else a noted error. */
int api_may_move(psabench *b, const char *function);

/* Lets everything up to t_ns happen, each instant reported as it comes. The caller has raised b->inside. No interrupt is
 * served, no deadline looked at. */
void api_move(psabench *b, int64_t t_ns);

/* The same to the next instant at which something happens, at most to t_ns; whether there is one. */
void api_step(psabench *b, int64_t t_ns);
bool api_has_time(const psabench *b, int64_t t_ns);

/* The deadline is over: calls its function and returns PSABENCH_DEADLINE; else PSABENCH_OK. Outside callbacks. */
int api_late(psabench *b);

/* A program reads a pin: PSABENCH_DEADLINE if it does so without end. */
int api_poll(psabench *b);

/* Serves the interrupts that wait, if none is being served and they are not masked. Outside callbacks. */
void api_serve(psabench *b);
bool api_pending(const psabench *b);

/* Reports what has changed since the last report. */
void api_notify(psabench *b);

/* Pins whose changes are reported: watched, recorded, counted or armed. */
static inline uint32_t api_observed(const struct psabench_part *p)
{
    return p->watched | p->recorded | p->counted | p->armed;
}

/* Before a pin joins those: changes count from now. */
void api_observe(struct psabench_part *p, unsigned pin);

/* Row of a pin, NULL if there is none, and the error then. */
const struct api_pin *api_pin_of(const struct psabench_part *p, int pin);
int api_no_pin(const struct psabench_part *p, int pin);

/* Level now. */
static inline bool api_level(const struct psabench_part *p, unsigned pin)
{
    const struct api_pin *row = &p->kind->pins[pin];
    return row->get ? row->get(p, row->arg) : p->level >> pin & 1;
}

/* An error for lines that are known only afterwards. */
int api_not_late(const struct psabench_part *p, const struct api_pin *row);

/* Whether a change to this level is such an edge. */
static inline bool api_is_edge(enum psabench_edge edge, bool level)
{
    return edge == PSABENCH_EITHER || (edge == PSABENCH_RISING) == level;
}

/* For edges: an output of a part that reports them at once; else a noted error. */
int api_edge_pin(const struct psabench_part *p, int pin, int edge, const char *function);

#endif
