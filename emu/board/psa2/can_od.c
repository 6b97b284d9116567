#include "board/psa2/can_internal.h"

#include <string.h>

enum { NS_PER_TICK = 4000, NS_PER_US = 1000, AXES = 3 };

static const double volt_per_lsb = 10.0 / 8388608.0; /* nominal, at the load */

/* ---- settings ---- */

static double entry_default(uint16_t index, uint8_t sub)
{
    uint32_t abort = CO_OK;
    const struct co_entry *e = co_find(&psa2_od, index, sub, &abort);
    return e ? e->value : 0.0;
}

void psa2_can_defaults(struct psa2_can *c)
{
    c->set = (struct psa2_can_settings){
        .form = (uint8_t)entry_default(PSA2_OD_FRAME_FORM, 0),
        .sample_mode = (uint8_t)entry_default(PSA2_OD_SAMPLE_MODE, 0),
        .nth = (uint16_t)entry_default(PSA2_OD_SAMPLE_NTH, 0),
        .sync_pin = entry_default(PSA2_OD_SYNC_PIN, 0) != 0.0,
    };
    for (unsigned i = 0; i < AXES; i++) {
        c->set.zero_v[i] = (float)entry_default(PSA2_OD_ZERO_V, (uint8_t)(i + 1));
        c->set.scale_v_per_g[i] = (float)entry_default(PSA2_OD_SCALE_V_PER_G, (uint8_t)(i + 1));
    }
}

/* A setting of the stream holds only if the bus can carry what it asks for. */
static uint32_t set_stream(struct psa2_can *c, const struct psa2_can_settings *want, int64_t t_ns)
{
    const int64_t period_ns = psa2_can_info(c).period_ns;
    if (!psa2_can_judge(c, want, period_ns, t_ns)) return CO_AB_STATE;
    c->set = *want;
    c->checked_period_ns = period_ns;
    c->fits = true;
    psa2_can_stream_restart(c);
    return CO_OK;
}

static uint32_t write_form(struct psa2_can *c, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)e;
    struct psa2_can_settings want = c->set;
    want.form = (uint8_t)v->number;
    return set_stream(c, &want, t_ns);
}

static uint32_t write_mode(struct psa2_can *c, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)e;
    struct psa2_can_settings want = c->set;
    want.sample_mode = (uint8_t)v->number;
    return set_stream(c, &want, t_ns);
}

static uint32_t write_nth(struct psa2_can *c, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)e;
    struct psa2_can_settings want = c->set;
    want.nth = (uint16_t)v->number;
    return set_stream(c, &want, t_ns);
}

static uint32_t read_settings(struct psa2_can *c, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)t_ns;
    switch (e->index) {
    case PSA2_OD_FRAME_FORM:
        v->number = c->set.form;
        return CO_OK;
    case PSA2_OD_SAMPLE_MODE:
        v->number = c->set.sample_mode;
        return CO_OK;
    case PSA2_OD_SAMPLE_NTH:
        v->number = c->set.nth;
        return CO_OK;
    case PSA2_OD_SYNC_PIN:
        v->number = c->set.sync_pin;
        return CO_OK;
    case PSA2_OD_ZERO_V:
        v->number = (double)c->set.zero_v[e->sub - 1];
        return CO_OK;
    case PSA2_OD_SCALE_V_PER_G:
        v->number = (double)c->set.scale_v_per_g[e->sub - 1];
        return CO_OK;
    default:
        return CO_AB_NO_OBJECT;
    }
}

static uint32_t write_plain(struct psa2_can *c, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)t_ns;
    switch (e->index) {
    case PSA2_OD_SYNC_PIN:
        c->set.sync_pin = v->number != 0.0;
        return CO_OK;
    case PSA2_OD_ZERO_V:
        c->set.zero_v[e->sub - 1] = (float)v->number;
        return CO_OK;
    case PSA2_OD_SCALE_V_PER_G:
        c->set.scale_v_per_g[e->sub - 1] = (float)v->number;
        return CO_OK;
    default:
        return CO_AB_NO_OBJECT;
    }
}

/* ---- registers and opcodes ---- */

/* Whose registers an object is; the sub-index is the address plus one. */
static unsigned axis_of(uint16_t index)
{
    return index == PSA2_OD_REG_Y ? 1 : index == PSA2_OD_REG_Z ? 2 : 0;
}

static enum psa2_group group_of(const struct co_entry *e)
{
    if (e->index == PSA2_OD_OPCODE) return e->sub == 1 ? PSA2_ACCEL : PSA2_TEMP;
    return e->index == PSA2_OD_REG_T ? PSA2_TEMP : PSA2_ACCEL;
}

static uint32_t read_register(struct psa2_can *c, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)v;
    return psa2_can_submit(c, group_of(e), PSA2_READ_REG, (uint8_t)(e->sub - 1), 0, axis_of(e->index), t_ns);
}

static uint32_t write_register(struct psa2_can *c, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    const uint8_t addr = (uint8_t)(e->sub - 1);
    const uint8_t value = (uint8_t)v->number;
    const enum psa2_group group = group_of(e);
    if (group == PSA2_ACCEL && addr == ADS1282_CONFIG0) {
        const int64_t period_ns = psa2_can_config0_period_ns(psa2_can_info(c).fclk_hz, value);
        if (period_ns > 0 && !psa2_can_judge(c, &c->set, period_ns, t_ns)) return CO_AB_STATE;
    }
    return psa2_can_submit(c, group, PSA2_WRITE_REG, addr, value, 0, t_ns);
}

static uint32_t write_opcode(struct psa2_can *c, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    return psa2_can_submit(c, group_of(e), PSA2_OPCODE, 0, (uint8_t)v->number, 0, t_ns);
}

/* ---- counters and identity ---- */

/* Sub-indices in order; TEC, REC and state (5..7) stay 0: no errors on the wire are modelled. */
static uint32_t read_counter(struct psa2_can *c, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    enum { LOAD = 4 };
    const struct psa2_counters n = psa2_can_info(c).counters;
    const uint32_t value[] = {0,
                              n.frames,
                              n.overruns,
                              c->dropped + c->node.pdo_lost,
                              0,
                              0,
                              0,
                              0,
                              n.int_late,
                              n.timeouts,
                              c->node.pdo_inhibited,
                              c->node.syncs,
                              c->syncs_missed,
                              c->node.sdo.aborts,
                              c->node.malformed + c->node.sdo.malformed};
    if (e->sub >= sizeof value / sizeof value[0]) return CO_AB_NO_SUB;
    v->number = e->sub == LOAD ? (double)can_load_since(&c->load, c->bus, t_ns) : (double)value[e->sub];
    return CO_OK;
}

static uint32_t read_unit(struct psa2_can *c, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)t_ns;
    const struct psa2_can_info info = psa2_can_info(c);
    v->number = e->index == PSA2_OD_IDENTITY ? (double)info.serial : (double)info.word_bits;
    return CO_OK;
}

/* ---- texts ---- */

static uint32_t read_text(struct psa2_can *c, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)t_ns;
    const char *text = e->index == PSA2_OD_REFUSAL ? c->refusal : c->remark;
    v->len = (uint16_t)strlen(text);
    memcpy(v->text, text, (size_t)v->len + 1);
    return CO_OK;
}

static uint32_t write_remark(struct psa2_can *c, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)e;
    (void)t_ns;
    const size_t n = v->len < PSA2_CAN_REMARK ? v->len : PSA2_CAN_REMARK;
    memcpy(c->remark, v->text, n);
    c->remark[n] = '\0';
    return CO_OK;
}

/* ---- latest sample ---- */

static double accel_g(const struct psa2_can *c, unsigned axis)
{
    const double v = c->latest.code[axis] * volt_per_lsb;
    return (v - (double)c->set.zero_v[axis]) / (double)c->set.scale_v_per_g[axis];
}

static double frame_head(const struct psa2_frame *f, uint8_t sub)
{
    switch (sub) {
    case 1:
        return (uint16_t)f->seq;
    case 2:
        return (uint8_t)((f->status & 0x0F) | f->temp_channel << 4);
    case 3:
        return (uint16_t)((uint64_t)f->t_sample_ns / NS_PER_TICK);
    case 4:
        return (int16_t)f->temp_code;
    default:
        return (uint32_t)((uint64_t)f->t_sample_ns / NS_PER_US);
    }
}

static uint32_t read_latest(struct psa2_can *c, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)t_ns;
    const struct psa2_frame *f = &c->latest;
    const unsigned axis = (unsigned)e->sub - 1;
    switch (e->index) {
    case PSA2_OD_CODES:
        v->number = axis < AXES ? f->code[axis] : (int16_t)f->temp_code;
        return CO_OK;
    case PSA2_OD_RAW_WORDS:
        v->number = (int32_t)f->raw[axis];
        return CO_OK;
    case PSA2_OD_FRAME_HEAD:
        v->number = frame_head(f, e->sub);
        return CO_OK;
    case PSA2_OD_ACCEL_G:
        v->number = accel_g(c, axis);
        return CO_OK;
    case PSA2_OD_ACCEL_UG:
        v->number = 1e6 * accel_g(c, axis);
        return CO_OK;
    default:
        return CO_AB_NO_OBJECT;
    }
}

/* ---- which function answers for an object ---- */

static const struct {
    uint16_t index;
    uint32_t (*read)(struct psa2_can *c, const struct co_entry *e, struct co_value *v, int64_t t_ns);
    uint32_t (*write)(struct psa2_can *c, const struct co_entry *e, const struct co_value *v, int64_t t_ns);
} handlers[] = {
    {PSA2_OD_IDENTITY, read_unit, NULL},
    {PSA2_OD_REG_X, read_register, write_register},
    {PSA2_OD_REG_Y, read_register, write_register},
    {PSA2_OD_REG_Z, read_register, write_register},
    {PSA2_OD_REG_T, read_register, write_register},
    {PSA2_OD_OPCODE, NULL, write_opcode},
    {PSA2_OD_FRAME_FORM, read_settings, write_form},
    {PSA2_OD_WORD_BITS, read_unit, NULL},
    {PSA2_OD_SAMPLE_MODE, read_settings, write_mode},
    {PSA2_OD_SAMPLE_NTH, read_settings, write_nth},
    {PSA2_OD_SYNC_PIN, read_settings, write_plain},
    {PSA2_OD_COUNTERS, read_counter, NULL},
    {PSA2_OD_REFUSAL, read_text, NULL},
    {PSA2_OD_REMARK, read_text, write_remark},
    {PSA2_OD_CODES, read_latest, NULL},
    {PSA2_OD_RAW_WORDS, read_latest, NULL},
    {PSA2_OD_FRAME_HEAD, read_latest, NULL},
    {PSA2_OD_ZERO_V, read_settings, write_plain},
    {PSA2_OD_SCALE_V_PER_G, read_settings, write_plain},
    {PSA2_OD_ACCEL_G, read_latest, NULL},
    {PSA2_OD_ACCEL_UG, read_latest, NULL},
};

uint32_t psa2_can_read(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    for (size_t i = 0; i < sizeof handlers / sizeof handlers[0]; i++) {
        if (handlers[i].index == e->index && handlers[i].read) return handlers[i].read(ctx, e, v, t_ns);
    }
    return CO_AB_NO_OBJECT;
}

uint32_t psa2_can_write(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    for (size_t i = 0; i < sizeof handlers / sizeof handlers[0]; i++) {
        if (handlers[i].index == e->index && handlers[i].write) return handlers[i].write(ctx, e, v, t_ns);
    }
    return CO_AB_NO_OBJECT;
}
