/* Parameter protocol: requests become jobs, one at a time; a list runs while no job waits. A value is read from the unit
 * when it is asked for, and read back after it was written, so that what is sent is what the unit has. */
#include "link/mavlink/mav_station.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { RATE_MAX_HZ = 10000 };
static const double rate_min_hz = 0.01; /* and 0: off */

const struct mav_param mav_own_params[MAV_OWN_PARAMS] = {
    [MAV_OWN_IMU_HZ] = {"MAV_IMU_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = RATE_MAX_HZ},
    [MAV_OWN_ANGLES_HZ] = {"MAV_ANGLES_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = RATE_MAX_HZ},
    [MAV_OWN_CODES_HZ] = {"MAV_CODES_HZ", .writable = true, .bytes = 4, .code = MAV_CODE_REAL, .high = RATE_MAX_HZ},
};

static const struct {
    uint32_t id[2]; /* messages whose rate it is; 0: none */
} own_streams[MAV_OWN_PARAMS] = {
    [MAV_OWN_IMU_HZ] = {{MAVLINK_MSG_ID_HIGHRES_IMU, 0}},
    [MAV_OWN_ANGLES_HZ] = {{MAVLINK_MSG_ID_PSABENCH_ANGLES, MAVLINK_MSG_ID_ATTITUDE}},
    [MAV_OWN_CODES_HZ] = {{MAVLINK_MSG_ID_PSABENCH_ACCEL, 0}},
};

/* ---- values of the link and the bench */

/* Of a rate: 0 off; the greatest there is: with each reading. */
static double own_rate_hz(const struct mav_station *s, unsigned own)
{
    const int64_t ns = s->stream[mav_stream_find(own_streams[own].id[0])].interval_ns;
    return ns < 0 ? 0.0 : ns == 0 ? RATE_MAX_HZ : 1e9 / (double)ns;
}

static void set_own_rate(struct mav_station *s, unsigned own, double hz, int64_t t_ns)
{
    const bool by_reading = own != MAV_OWN_ANGLES_HZ;
    const int64_t ns = hz <= 0 ? -1 : by_reading && hz >= RATE_MAX_HZ ? 0 : (int64_t)nearbyint(1e9 / hz);
    for (unsigned k = 0; k < 2 && own_streams[own].id[k]; k++)
        (void)mav_stream_set(s, mav_stream_find(own_streams[own].id[k]), ns, t_ns);
}

/* ---- answers */

static void send_value(struct mav_station *s, unsigned i, double value)
{
    const struct mav_param *p = &s->cfg.params[i];
    mavlink_param_value_t m = {.param_value = mav_param_wire(p, value),
                               .param_count = (uint16_t)s->cfg.param_count,
                               .param_index = (uint16_t)i,
                               .param_type = (uint8_t)mav_param_type(p)};
    memcpy(m.param_id, p->name, strlen(p->name)); /* at most MAV_PARAM_NAME, as many as there is room for */
    mav_send(s, MAV_KIND(PARAM_VALUE), &m);
}

static void tell_refusal(struct mav_station *s, const char *name, const char *why)
{
    char text[128];
    snprintf(text, sizeof text, "%s: %s", name, why);
    s->counters.params_refused++;
    mav_text_out(s, MAV_SEVERITY_WARNING, text);
}

static void tell_range(struct mav_station *s, const struct mav_param *p)
{
    char why[96];
    snprintf(why, sizeof why, "expected %s from %.9g to %.9g", p->code == MAV_CODE_REAL ? "a number" : "an integer",
             p->low, p->high);
    tell_refusal(s, p->name, why);
}

static void tell_abort(struct mav_station *s, const struct mav_param *p, uint32_t abort)
{
    char why[48];
    snprintf(why, sizeof why, "the unit rejects it, abort %08XH", (unsigned)abort);
    tell_refusal(s, p->name, abort == MAV_SDO_NO_ANSWER ? "the unit does not answer" : why);
}

/* ---- jobs */

static void add_job(struct mav_station *s, enum mav_job_kind kind, unsigned param, double value)
{
    if (s->job_count == MAV_PARAM_JOBS) {
        s->counters.jobs_dropped++; /* the client asks again */
        return;
    }
    s->job[(s->job_first + s->job_count++) % MAV_PARAM_JOBS] = (struct mav_job){kind, param, value};
}

static void end_job(struct mav_station *s)
{
    s->job_first = (s->job_first + 1) % MAV_PARAM_JOBS;
    s->job_count--;
    s->busy = false;
}

static void do_own_job(struct mav_station *s, const struct mav_job *j, int64_t t_ns)
{
    const unsigned which = s->cfg.params[j->param].index;
    const bool of_link = j->param < MAV_OWN_PARAMS;
    if (j->kind == MAV_JOB_WRITE && of_link) set_own_rate(s, which, j->value, t_ns);
    send_value(s, j->param, of_link ? own_rate_hz(s, j->param) : s->io.value(s->io.ctx, which, t_ns));
    end_job(s);
}

static void begin_access(struct mav_station *s, const struct mav_job *j)
{
    const struct mav_param *p = &s->cfg.params[j->param];
    const bool write = j->kind == MAV_JOB_WRITE;
    const struct mav_access a = {.write = write,
                                 .index = p->index,
                                 .sub = p->sub,
                                 .bytes = p->bytes,
                                 .raw = write ? mav_param_raw(p, j->value) : 0};
    s->busy = true;
    mav_sdo_begin(&s->sdo, &a);
}

void mav_params_turn(struct mav_station *s, int64_t t_ns)
{
    while (!s->busy && (s->job_count || s->list_at < s->cfg.param_count)) {
        if (s->job_count == 0) add_job(s, MAV_JOB_READ, s->list_at++, 0);
        const struct mav_job *j = &s->job[s->job_first];
        if (s->cfg.params[j->param].object) begin_access(s, j);
        else do_own_job(s, j, t_ns);
    }
}

/* Zero signal and scale factor follow what anyone writes to the unit, and what we read. */
static void note_scale(struct mav_station *s, uint16_t index, uint8_t sub, uint32_t raw)
{
    static const struct mav_param real = {.bytes = 4, .code = MAV_CODE_REAL};
    const double value = mav_param_number(&real, raw);
    if (sub < 1 || sub > 3 || !isfinite(value)) return;
    if (index == s->cfg.zero_index) s->cfg.zero_v[sub - 1] = value;
    if (index == s->cfg.scale_index && value > 0) s->cfg.scale_v_per_g[sub - 1] = value;
}

void mav_params_answer(void *ctx, uint32_t abort, uint32_t raw, int64_t t_ns)
{
    struct mav_station *s = ctx;
    struct mav_job *j = &s->job[s->job_first];
    const struct mav_param *p = &s->cfg.params[j->param];
    (void)t_ns;
    s->busy = false;
    if (abort) tell_abort(s, p, abort);
    if (j->kind == MAV_JOB_WRITE && abort != MAV_SDO_NO_ANSWER) { /* what it has now, changed or not */
        j->kind = MAV_JOB_READ;
        return;
    }
    if (!abort && p->index) note_scale(s, p->index, p->sub, raw);
    if (!abort) send_value(s, j->param, mav_param_number(p, raw));
    else if (mav_param_type(p) == MAV_PARAM_R32) send_value(s, j->param, NAN);
    if (abort == MAV_SDO_NO_ANSWER) s->list_at = s->cfg.param_count; /* the unit is off: the list ends */
    end_job(s);
}

/* ---- requests */

static void take_list(struct mav_station *s, const mavlink_message_t *m)
{
    mavlink_param_request_list_t in;
    mavlink_msg_param_request_list_decode(m, &in);
    if (mav_is_for_us(s, in.target_system, in.target_component)) s->list_at = 0;
}

static void take_read(struct mav_station *s, const mavlink_message_t *m)
{
    mavlink_param_request_read_t in;
    char name[MAV_PARAM_NAME + 1];
    mavlink_msg_param_request_read_decode(m, &in);
    if (!mav_is_for_us(s, in.target_system, in.target_component)) return;
    mav_text(name, in.param_id, MAV_PARAM_NAME);
    const unsigned count = s->cfg.param_count;
    const unsigned i = in.param_index >= 0 ? (unsigned)in.param_index : mav_param_find(s->cfg.params, count, name);
    if (i < count) add_job(s, MAV_JOB_READ, i, 0);
    else tell_refusal(s, in.param_index >= 0 ? "parameter" : name, "expected a parameter of this system");
}

static void take_set(struct mav_station *s, const mavlink_message_t *m)
{
    mavlink_param_set_t in;
    char name[MAV_PARAM_NAME + 1];
    double value = 0;
    mavlink_msg_param_set_decode(m, &in);
    if (!mav_is_for_us(s, in.target_system, in.target_component)) return;
    mav_text(name, in.param_id, MAV_PARAM_NAME);
    const unsigned i = mav_param_find(s->cfg.params, s->cfg.param_count, name);
    if (i == s->cfg.param_count) {
        tell_refusal(s, name, "expected a parameter of this system");
        return;
    }
    const struct mav_param *p = &s->cfg.params[i];
    const bool fits = mav_param_value(p, in.param_type, in.param_value, &value) && value >= p->low &&
                      value <= p->high && (i >= MAV_OWN_PARAMS || value == 0 || value >= rate_min_hz);
    if (!p->writable) tell_refusal(s, name, "read-only");
    else if (!fits) tell_range(s, p);
    add_job(s, p->writable && fits ? MAV_JOB_WRITE : MAV_JOB_READ, i, value); /* rejected: the value that it keeps */
}

void mav_params_message(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns)
{
    (void)t_ns;
    if (m->msgid == MAVLINK_MSG_ID_PARAM_REQUEST_LIST) take_list(s, m);
    else if (m->msgid == MAVLINK_MSG_ID_PARAM_REQUEST_READ) take_read(s, m);
    else take_set(s, m);
}

/* A confirmed write of another host: the request is remembered until the unit answers. */
void mav_station_frame(struct mav_station *s, const struct can_msg *m, int64_t t_ns)
{
    enum { REQUEST = 0x600, ANSWER = 0x580, WRITE_4 = 0x23, WRITTEN = 0x60 };
    const bool sdo = m->len == 8 && m->flags == 0;
    const uint32_t node = s->sdo.node;
    if (sdo && m->id == REQUEST + node) s->write_seen = *m;
    const uint8_t *w = s->write_seen.data;
    if (sdo && m->id == ANSWER + node && m->data[0] == WRITTEN && w[0] == WRITE_4 && !memcmp(&w[1], &m->data[1], 3))
        note_scale(s, (uint16_t)(w[1] | w[2] << 8), w[3],
                   (uint32_t)w[4] | (uint32_t)w[5] << 8 | (uint32_t)w[6] << 16 | (uint32_t)w[7] << 24);
    mav_sdo_frame(&s->sdo, m, t_ns);
}
