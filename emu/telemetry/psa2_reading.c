#include "telemetry/psa2_reading.h"

#include "board/psa2/psa2.h"
#include "gen/psa2_od.h"
#include "gen/psabench_can.h"
#include "gen/psabench_scale.h"

#include <math.h>
#include <string.h>

enum { DBC_NODE = 5, SHIFT_FAST = 8, NS_PER_US = 1000, NS_PER_TICK = 4000 };

static uint8_t status_of(unsigned settled, unsigned clip, unsigned overrun, unsigned temp_new)
{
    return (uint8_t)((settled ? PSA2_ST_SETTLED : 0) | (clip ? PSA2_ST_CLIP : 0) | (overrun ? PSA2_ST_OVERRUN : 0) |
                     (temp_new ? PSA2_ST_TEMP_NEW : 0));
}

static void set_codes(struct psa2_reading *r, int32_t x, int32_t y, int32_t z)
{
    const int32_t code[3] = {x, y, z};
    const double scale_v[3] = {PSABENCH_PSA2_XY_X_SCALE, PSABENCH_PSA2_XY_Y_SCALE, PSABENCH_PSA2_ZT_Z_SCALE};
    for (unsigned k = 0; k < 3; k++) {
        r->code[k] = code[k];
        r->volts[k] = code[k] * scale_v[k];
    }
}

/* The latest instant up to t_ns that has this wrapping time stamp. */
static int64_t unwrap_ns(uint64_t stamp, int64_t unit_ns, unsigned bits, int64_t t_ns)
{
    const uint64_t now = (uint64_t)(t_ns / unit_ns);
    const uint64_t age = (now - stamp) & ((UINT64_C(1) << bits) - 1);
    return now >= age ? (int64_t)(now - age) * unit_ns : t_ns;
}

/* Numbers missing before this one; a board that was reset begins at 0. */
static uint32_t gap_before(struct psa2_reader *d, uint16_t seq)
{
    const uint16_t gap = (uint16_t)(seq - d->seq - 1);
    const uint32_t lost = d->has_seq && seq != 0 ? gap : 0;
    d->seq = seq;
    d->has_seq = true;
    return lost;
}

static unsigned take_xy(struct psa2_reader *d, const struct can_msg *m, int64_t t_ns, struct psa2_reading *out)
{
    (void)t_ns;
    (void)out;
    d->xy = *m;
    d->has_xy = true;
    return 0;
}

static unsigned take_zt(struct psa2_reader *d, const struct can_msg *m, int64_t t_ns, struct psa2_reading *out)
{
    struct psabench_psa2_xy_t xy;
    struct psabench_psa2_zt_t zt;
    if (!d->has_xy) return 0;
    d->has_xy = false;
    psabench_psa2_xy_unpack(&xy, d->xy.data, d->xy.len);
    psabench_psa2_zt_unpack(&zt, m->data, m->len);
    *out = (struct psa2_reading){.form = PSA2_FORM_PAIR,
                                 .sequence = xy.seq,
                                 .t_sample_s = zt.tstamp * PSABENCH_PSA2_ZT_TSTAMP_SCALE,
                                 .t_ns = unwrap_ns(zt.tstamp, NS_PER_TICK, 16, t_ns),
                                 .lost = gap_before(d, xy.seq),
                                 .temp_code = zt.t,
                                 .temp_channel = (int8_t)zt.channel,
                                 .status = status_of(zt.settled, zt.clip, zt.overrun, zt.t_new)};
    set_codes(out, xy.x, xy.y, zt.z);
    return 1;
}

static unsigned take_fast(struct psa2_reader *d, const struct can_msg *m, int64_t t_ns, struct psa2_reading *out)
{
    struct psabench_psa2_fast_t f;
    psabench_psa2_fast_unpack(&f, m->data, m->len);
    *out = (struct psa2_reading){.form = PSA2_FORM_FAST,
                                 .sequence = -1,
                                 .t_sample_s = NAN,
                                 .t_ns = t_ns,
                                 .lost = d->has_toggle && f.tog == d->toggle,
                                 .temp_channel = -1};
    set_codes(out, f.x * SHIFT_FAST, f.y * SHIFT_FAST, f.z * SHIFT_FAST);
    d->toggle = f.tog;
    d->has_toggle = true;
    return 1;
}

static unsigned take_frame(struct psa2_reader *d, const struct can_msg *m, int64_t t_ns, struct psa2_reading *out)
{
    struct psabench_psa2_frame_t f;
    (void)d;
    psabench_psa2_frame_unpack(&f, m->data, m->len);
    *out = (struct psa2_reading){.form = PSA2_FORM_FRAME,
                                 .sequence = -1,
                                 .t_sample_s = f.tstamp * PSABENCH_PSA2_FRAME_TSTAMP_SCALE,
                                 .t_ns = unwrap_ns(f.tstamp, NS_PER_US, 32, t_ns),
                                 .temp_code = f.t,
                                 .temp_channel = (int8_t)f.channel,
                                 .status = status_of(f.settled, f.clip, f.overrun, f.t_new)};
    set_codes(out, f.x, f.y, f.z);
    return 1;
}

/* A sample of a block has the bits of a PSA2_FRAME but for the time stamp; the samples follow the first in equal steps. */
static unsigned take_block(struct psa2_reader *d, const struct can_msg *m, int64_t t_ns, struct psa2_reading *out)
{
    enum { HEAD = 4, SAMPLE = 12, COUNT = PSA2_READINGS_MAX };
    const uint32_t stamp_us =
        (uint32_t)m->data[0] | (uint32_t)m->data[1] << 8 | (uint32_t)m->data[2] << 16 | (uint32_t)m->data[3] << 24;
    const int64_t first_ns = unwrap_ns(stamp_us, NS_PER_US, 32, t_ns);
    const uint32_t since_us = stamp_us - d->block_us;
    const int64_t guess_ns = (t_ns - first_ns) / COUNT; /* the first block: sent with its last sample */
    const bool plausible = d->has_block && since_us * (int64_t)NS_PER_US < 2 * (t_ns - first_ns) + NS_PER_S / 1000;
    const int64_t step_ns = plausible ? since_us * (int64_t)NS_PER_US / COUNT : guess_ns;
    for (unsigned k = 0; k < COUNT; k++) {
        struct can_msg one = {.len = PSABENCH_PSA2_FRAME_LENGTH};
        memcpy(one.data, &m->data[HEAD + SAMPLE * k], SAMPLE);
        (void)take_frame(d, &one, t_ns, &out[k]);
        out[k].form = PSA2_FORM_BLOCK;
        out[k].sample = (uint8_t)k;
        out[k].t_sample_s = k ? NAN : stamp_us * PSABENCH_PSA2_BLOCK_TSTAMP_SCALE;
        out[k].t_ns = first_ns + step_ns * (int64_t)k;
    }
    d->block_us = stamp_us;
    d->has_block = true;
    return COUNT;
}

static const struct {
    uint32_t id;
    uint8_t flags, len;
    unsigned (*take)(struct psa2_reader *d, const struct can_msg *m, int64_t t_ns, struct psa2_reading *out);
} rows[] = {
    {PSABENCH_PSA2_XY_FRAME_ID, 0, PSABENCH_PSA2_XY_LENGTH, take_xy},
    {PSABENCH_PSA2_ZT_FRAME_ID, 0, PSABENCH_PSA2_ZT_LENGTH, take_zt},
    {PSABENCH_PSA2_FAST_FRAME_ID, 0, PSABENCH_PSA2_FAST_LENGTH, take_fast},
    {PSABENCH_PSA2_FRAME_FRAME_ID, CAN_FD, PSABENCH_PSA2_FRAME_LENGTH, take_frame},
    {PSABENCH_PSA2_BLOCK_FRAME_ID, CAN_FD, PSABENCH_PSA2_BLOCK_LENGTH, take_block},
};

unsigned psa2_reading_take(struct psa2_reader *d, const struct can_msg *m, int64_t t_ns,
                           struct psa2_reading out[PSA2_READINGS_MAX])
{
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        const uint32_t id = rows[i].id - DBC_NODE + d->node;
        if (m->id == id && (m->flags & ~(unsigned)CAN_BRS) == rows[i].flags && m->len == rows[i].len)
            return rows[i].take(d, m, t_ns, out);
    }
    return 0;
}
