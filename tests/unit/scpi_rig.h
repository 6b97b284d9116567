/* A laboratory with all four instruments and no board, and one SCPI session with one of them. */
#ifndef PSABENCH_TESTS_SCPI_RIG_H
#define PSABENCH_TESTS_SCPI_RIG_H

#include "scpi/scpi.h"

#include <string.h>

struct scpi_rig {
    struct sched sched;
    struct lab lab;
    struct control_bench bench;
    struct control control;
    struct scpi scpi;
    char said[SCPI_OUT_MAX + 1]; /* the latest answer; "" when there was none to the latest line */
    unsigned answers, idles;
};

static inline void scpi_rig_reply(void *ctx, const char *text, size_t n)
{
    struct scpi_rig *r = ctx;
    memcpy(r->said, text, n);
    r->said[n] = '\0';
    r->answers++;
}

static inline void scpi_rig_idle(void *ctx, int64_t t_ns)
{
    (void)t_ns;
    ((struct scpi_rig *)ctx)->idles++;
}

/* Another client of the same laboratory: session filled in and opened. */
static inline void scpi_rig_session(struct scpi_rig *r, struct scpi *s, const char *kind)
{
    s->kind = scpi_kind(kind);
    s->control = &r->control;
    s->sched = &r->sched;
    s->reply = scpi_rig_reply;
    s->idle = scpi_rig_idle;
    s->ctx = r;
    scpi_open(s);
}

/* r is on the heap or static; it must not move. A head that takes 2 s, a table of two axes (720 deg/s, 500 deg/s^2), a chamber
 * of -60 ... +85 degC at up to 5 K/min, a supply of 12 V. */
static inline void scpi_rig_init(struct scpi_rig *r, const char *kind)
{
    struct lab_cfg cfg = lab_default();
    memset(r, 0, sizeof *r);
    cfg.head.turn_s = 2;
    cfg.head.resolution_arcsec = 0;
    cfg.table = table_default(2);
    for (unsigned i = 0; i < 2; i++) {
        struct table_axis_cfg *a = &cfg.table.axis[i];
        *a = (struct table_axis_cfg){.along = a->along, .rate_max_dps = 720, .accel_max_dps2 = 500};
    }
    cfg.chamber = chamber_default();
    cfg.chamber.present = true;
    cfg.chamber.heating_max_k_per_min = cfg.chamber.cooling_max_k_per_min = 5;
    cfg.chamber.start_degc = 25;
    cfg.chamber.readout_offset_k = cfg.chamber.readout_resolution_k = 0;
    cfg.supply = supply_default();
    cfg.supply.present = true;
    cfg.supply.slew_v_per_s = 0;
    cfg.supply.readout_resolution_v = 0;
    sched_init(&r->sched);
    lab_init(&r->lab, &cfg, 1);
    r->bench = (struct control_bench){.lab = &r->lab};
    control_init(&r->control, control_tables, &r->bench);
    scpi_rig_session(r, &r->scpi, kind);
}

static inline const char *scpi_rig_say(struct scpi_rig *r, struct scpi *s, const char *line)
{
    r->said[0] = '\0';
    scpi_line(s, line, strlen(line), r->sched.now_ns);
    return r->said;
}

#endif
