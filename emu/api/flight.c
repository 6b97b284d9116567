/* An aircraft's flight without a unit and without a bench. */
#include "api/internal.h"
#include "api/psabench_models.h"
#include "phys/flight/increment.h"
#include "phys/flight/ranges.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

_Static_assert((int)PSABENCH_FLIGHT_PARAMS == (int)FLIGHT_PARAMS, "parameters of a leg");

#define HEIGHT_MIN_M (-1000.0)
#define HEIGHT_MAX_M 9000.0

struct range {
    const char *key;
    double least, most;
};

// clang-format off
#define LEG_ROW(at, name, lo, hi, words) [at] = {#name, lo, hi},
#define ROW(name, lo, hi, words) {#name, lo, hi},
static const struct range kinds[FLIGHT_KINDS] = {FLIGHT_KIND_RANGES(LEG_ROW)};
static const struct range params[FLIGHT_PARAMS] = {FLIGHT_PARAM_RANGES(LEG_ROW)};
static const struct range plan_rows[] = {FLIGHT_PLAN_RANGES(ROW)}, baro_rows[] = {FLIGHT_BARO_RANGES(ROW)};
static const struct range place_rows[] = {
    {"latitude_deg", -FLIGHT_LATITUDE_MAX_DEG, FLIGHT_LATITUDE_MAX_DEG}, {"longitude_deg", -180.0, 180.0}, {"height_m", HEIGHT_MIN_M, HEIGHT_MAX_M},
};
// clang-format on

struct psabench_flight {
    struct flight f;
};

/* Where an error is written. */
struct error_text {
    char *at;
    size_t cap;
};

static bool is_within(const struct error_text *e, const char *where, const struct range *r, double value)
{
    if (value >= r->least && value <= r->most) return true; /* not a number: no */
    if (e->cap) snprintf(e->at, e->cap, "%s%s: expected %g to %g, got %g", where, r->key, r->least, r->most, value);
    return false;
}

static bool are_within(const struct error_text *e, const char *where, const struct range *rows, size_t count,
                       const double *values)
{
    for (size_t i = 0; i < count; i++)
        if (!is_within(e, where, &rows[i], values[i])) return false;
    return true;
}

/* One row of numbers. */
static bool read_leg(const struct error_text *e, unsigned number, const double *row, struct flight_leg *leg)
{
    static const struct range kind_range = {"kind", 0.0, FLIGHT_KINDS - 1};
    char where[32];
    snprintf(where, sizeof where, "legs[%u].", number);
    if (!is_within(e, where, &kind_range, row[0]) || !is_within(e, where, &kinds[(unsigned)row[0]], row[1]))
        return false;
    *leg = flight_leg_of((enum flight_leg_kind)row[0], row[1]);
    for (unsigned k = 0; k < FLIGHT_PARAMS; k++) {
        if (isnan(row[2 + k])) continue;
        if (!is_within(e, where, &params[k], row[2 + k])) return false;
        leg->param[k] = row[2 + k];
    }
    return true;
}

static bool read_cfg(const struct error_text *e, const struct psabench_flight_job *job, struct flight_cfg *c)
{
    const struct range legs = {"legs", 1.0, FLIGHT_LEGS_MAX};
    if (!are_within(e, "", place_rows, 3, job->place) || !are_within(e, "", plan_rows, 4, job->plan) ||
        !are_within(e, "baro.", baro_rows, 4, job->baro) || !is_within(e, "", &legs, job->legs))
        return false;
    c->plan = (struct flight_plan_cfg){job->plan[0], job->plan[1], job->plan[2], job->plan[3], job->legs, {{0}}};
    c->baro = (struct baro_cfg){job->baro[0], job->baro[1], job->baro[2], job->baro[3]};
    for (unsigned i = 0; i < job->legs; i++)
        if (!read_leg(e, i, job->leg + (size_t)i * PSABENCH_FLIGHT_LEG, &c->plan.leg[i])) return false;
    return true;
}

psabench_flight *psabench_flight_new(const struct psabench_flight_job *job, char *why, size_t cap)
{
    const struct error_text e = {why, why ? cap : 0};
    struct flight_cfg c = {.present = true};
    struct flight_error error;
    if (!job || job->size != sizeof *job || !job->leg || !read_cfg(&e, job, &c)) return NULL;
    const double lat_rad = job->place[0] * RAD_PER_DEG, lon_rad = job->place[1] * RAD_PER_DEG, h_m = job->place[2];
    const struct site site = {earth_gravity_mps2(lat_rad, h_m), lat_rad, lon_rad, h_m, 0.0, true};
    psabench_flight *f = malloc(sizeof *f);
    if (f && flight_init(&f->f, &c, &site, &error)) return f;
    if (f && e.cap) snprintf(e.at, e.cap, "legs[%u].%s: %s", error.leg, error.key, error.text);
    free(f);
    return NULL;
}

void psabench_flight_free(psabench_flight *f)
{
    free(f);
}

const char *psabench_flight_key(unsigned number)
{
    if (number < FLIGHT_KINDS) return kinds[number].key;
    return number < FLIGHT_KINDS + FLIGHT_PARAMS ? params[number - FLIGHT_KINDS].key : NULL;
}

int64_t psabench_flight_leg_ns(const psabench_flight *f, unsigned leg)
{
    return f && leg <= f->f.cfg.plan.legs ? f->f.plan.leg_ns[leg] : PSABENCH_BAD_ARGUMENT;
}

static void write_state(const struct flight *f, int64_t t_ns, double *out)
{
    struct flight_state s;
    flight_at(f, t_ns, &s);
    const double first[] = {s.lat_rad, s.lon_rad, s.h_m}, angles[] = {s.heading_rad, s.pitch_rad, s.roll_rad};
    const double last[] = {flight_baro_m(f, t_ns), earth_gravity_mps2(s.lat_rad, s.h_m)};
    memcpy(out, first, sizeof first);
    memcpy(out + 3, s.v_enu_mps, sizeof s.v_enu_mps);
    memcpy(out + 6, s.a_enu_mps2, sizeof s.a_enu_mps2);
    memcpy(out + 9, angles, sizeof angles);
    memcpy(out + 12, s.pose.C_nb, sizeof s.pose.C_nb);
    memcpy(out + 21, s.f_b_mps2, sizeof s.f_b_mps2);
    memcpy(out + 24, s.pose.w_ib_b_radps, sizeof s.pose.w_ib_b_radps);
    memcpy(out + 27, last, sizeof last);
}

int psabench_flight_states(const psabench_flight *f, const int64_t *t_ns, size_t n, double *out)
{
    if (!f || !t_ns || !out) return PSABENCH_BAD_ARGUMENT;
    for (size_t i = 0; i < n; i++) {
        if (t_ns[i] < 0 || t_ns[i] > API_TIME_MAX_NS) return PSABENCH_BAD_ARGUMENT;
        write_state(&f->f, t_ns[i], out + i * PSABENCH_FLIGHT_STATE);
    }
    return PSABENCH_OK;
}

int psabench_flight_increments(const psabench_flight *f, int64_t from_ns, int64_t dt_ns, size_t n, double *out)
{
    const int64_t longest_ns = INT64_C(10) * NS_PER_S;
    if (!f || !out || from_ns < 0 || from_ns > API_TIME_MAX_NS || dt_ns < 1 || dt_ns > longest_ns ||
        n > (size_t)((API_TIME_MAX_NS - from_ns) / dt_ns))
        return PSABENCH_BAD_ARGUMENT;
    for (size_t i = 0; i < n; i++) {
        const int64_t t_ns = from_ns + (int64_t)i * dt_ns;
        flight_increment(&f->f, t_ns, t_ns + dt_ns, out + 6 * i, out + 6 * i + 3);
    }
    return PSABENCH_OK;
}
