#include "telemetry/lcm_board.h"

#include "gen/lcm/psabench_lcm_psa2_reading_t.h"
#include "gen/psa2_od.h"
#include "gen/psabench_can.h"
#include "gen/psabench_scale.h"

#include <math.h>

enum { SETTLED = 1, CLIP = 2, OVERRUN = 4, T_NEW = 8, CHANNEL_SHIFT = 4 }; /* STATUS of a block's sample */

char *lcm_text(const char *text)
{
    union {
        const char *read;
        char *generated;
    } u = {.read = text};
    return u.generated;
}

static void send_reading(struct lcm_feed *f, struct lcm_unit *u, psabench_lcm_psa2_reading_t *r, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX];
    r->t_ns = t_ns;
    r->epoch_ns = f->epoch_ns;
    r->unit = lcm_text(u->name);
    r->x_v = r->x_code * PSABENCH_PSA2_XY_X_SCALE;
    r->y_v = r->y_code * PSABENCH_PSA2_XY_Y_SCALE;
    r->z_v = r->z_code * PSABENCH_PSA2_ZT_Z_SCALE;
    lcm_feed_send(f, u->readings, out, psabench_lcm_psa2_reading_t_encode(out, 0, sizeof out, r), t_ns);
}

void lcm_psa2_take_zt(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    struct psabench_psa2_xy_t xy;
    struct psabench_psa2_zt_t zt;
    if (!lcm_reading_complete(u, 1)) return;
    psabench_psa2_xy_unpack(&xy, u->part[0], sizeof u->part[0]);
    psabench_psa2_zt_unpack(&zt, m->data, m->len);
    psabench_lcm_psa2_reading_t r = {.form = PSA2_FORM_PAIR,
                                     .x_code = xy.x,
                                     .y_code = xy.y,
                                     .z_code = zt.z,
                                     .sequence = xy.seq,
                                     .t_sample_s = zt.tstamp * PSABENCH_PSA2_ZT_TSTAMP_SCALE,
                                     .temp_code = zt.t,
                                     .temp_channel = (int8_t)zt.channel,
                                     .temp_new = (int8_t)zt.t_new,
                                     .settled = (int8_t)zt.settled,
                                     .clipped = (int8_t)zt.clip,
                                     .overrun = (int8_t)zt.overrun};
    send_reading(f, u, &r, t_ns);
}

void lcm_psa2_take_fast(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    struct psabench_psa2_fast_t fast;
    psabench_psa2_fast_unpack(&fast, m->data, m->len);
    psabench_lcm_psa2_reading_t r = {.form = PSA2_FORM_FAST,
                                     .x_code = fast.x * 8,
                                     .y_code = fast.y * 8,
                                     .z_code = fast.z * 8,
                                     .sequence = -1,
                                     .t_sample_s = NAN,
                                     .temp_channel = -1,
                                     .settled = 1};
    send_reading(f, u, &r, t_ns);
}

void lcm_psa2_take_frame(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    struct psabench_psa2_frame_t p;
    psabench_psa2_frame_unpack(&p, m->data, m->len);
    psabench_lcm_psa2_reading_t r = {.form = PSA2_FORM_FRAME,
                                     .x_code = p.x,
                                     .y_code = p.y,
                                     .z_code = p.z,
                                     .sequence = -1,
                                     .t_sample_s = p.tstamp * PSABENCH_PSA2_FRAME_TSTAMP_SCALE,
                                     .temp_code = p.t,
                                     .temp_channel = (int8_t)p.channel,
                                     .temp_new = (int8_t)p.t_new,
                                     .settled = (int8_t)p.settled,
                                     .clipped = (int8_t)p.clip,
                                     .overrun = (int8_t)p.overrun};
    send_reading(f, u, &r, t_ns);
}

void lcm_psa2_take_block(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    struct psabench_psa2_block_t b;
    psabench_psa2_block_unpack(&b, m->data, m->len);
    const struct {
        int32_t x, y, z, temp;
        uint8_t status;
    } sample[PSA2_BLOCK_SAMPLES] = {{b.x0, b.y0, b.z0, b.t0, b.status0},
                                    {b.x1, b.y1, b.z1, b.t1, b.status1},
                                    {b.x2, b.y2, b.z2, b.t2, b.status2},
                                    {b.x3, b.y3, b.z3, b.t3, b.status3},
                                    {b.x4, b.y4, b.z4, b.t4, b.status4}};
    for (unsigned i = 0; i < PSA2_BLOCK_SAMPLES; i++) {
        const uint8_t status = sample[i].status;
        psabench_lcm_psa2_reading_t r = {.form = PSA2_FORM_BLOCK,
                                         .sample = (int8_t)i,
                                         .x_code = sample[i].x,
                                         .y_code = sample[i].y,
                                         .z_code = sample[i].z,
                                         .sequence = -1,
                                         .t_sample_s = i ? NAN : b.tstamp * PSABENCH_PSA2_BLOCK_TSTAMP_SCALE,
                                         .temp_code = sample[i].temp,
                                         .temp_channel = (int8_t)(status >> CHANNEL_SHIFT),
                                         .temp_new = (status & T_NEW) != 0,
                                         .settled = (status & SETTLED) != 0,
                                         .clipped = (status & CLIP) != 0,
                                         .overrun = (status & OVERRUN) != 0};
        send_reading(f, u, &r, t_ns);
    }
}
