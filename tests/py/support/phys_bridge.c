/* The physics of emu/phys as flat functions of numbers, for ctypes: compiled and loaded by tests/py/support/physics.py only. */
#include "phys/lab.h"
#include "phys/sensor/cvg.h"
#include "phys/sensor/mems.h"

#include <stdlib.h>

#define EXPORT __attribute__((visibility("default")))

EXPORT double bridge_gravity(double latitude_rad, double height_m)
{
    return earth_gravity_mps2(latitude_rad, height_m);
}

/* site: g, latitude, height, azimuth (rad), placed. axis rows: along, nonorthogonality, wobble, order, phase (arcsec, deg),
 * minimum and maximum deg, readout noise, resolution, delay, zero. */
EXPORT struct lab *bridge_lab(const double site[5], unsigned axes, const double axis[][11], const double tilt_arcsec[2],
                              double turn_s, uint64_t seed)
{
    struct lab *l = malloc(sizeof *l);
    struct lab_cfg c = lab_default();
    c.site = (struct site){.g_mps2 = site[0]};
    if (site[4] != 0.0)
        c.site = (struct site){.g_mps2 = earth_gravity_mps2(site[1], site[2]),
                               .latitude_rad = site[1],
                               .height_m = site[2],
                               .azimuth_rad = site[3],
                               .placed = true};
    c.table = table_default(axes);
    c.head.turn_s = turn_s;
    c.table.base_tilt_x_arcsec = tilt_arcsec[0];
    c.table.base_tilt_y_arcsec = tilt_arcsec[1];
    for (unsigned i = 0; i < axes; i++) {
        struct table_axis_cfg *a = &c.table.axis[i];
        a->along = (enum pose_axis)axis[i][0];
        a->nonorthogonality_arcsec = axis[i][1];
        a->wobble_arcsec = axis[i][2];
        a->wobble_order = (unsigned)axis[i][3];
        a->wobble_phase_deg = axis[i][4];
        a->angle_min_deg = axis[i][5];
        a->angle_max_deg = axis[i][6];
        a->readout_noise_arcsec_rms = axis[i][7];
        a->readout_resolution_arcsec = axis[i][8];
        a->readout_delay_s = axis[i][9];
        a->readout_zero_arcsec = axis[i][10];
    }
    if (l) lab_init(l, &c, seed);
    return l;
}

EXPORT void bridge_lab_free(struct lab *l)
{
    free(l);
}

EXPORT double bridge_g(const struct lab *l)
{
    return l->site.g_mps2;
}

EXPORT int bridge_position(struct lab *l, unsigned axis, double deg, double dps, int64_t t_ns)
{
    return (int)table_position(&l->table, axis, deg, dps, t_ns);
}

EXPORT int bridge_rate(struct lab *l, unsigned axis, double dps, int64_t t_ns)
{
    return (int)table_rate(&l->table, axis, dps, t_ns);
}

EXPORT int bridge_sine(struct lab *l, unsigned axis, double deg, double hz, int64_t t_ns)
{
    return (int)table_sine(&l->table, axis, deg, hz, t_ns);
}

EXPORT int bridge_profile(struct lab *l, unsigned axis, const double *s, const double *dps, unsigned n, int64_t t_ns)
{
    return (int)table_profile(&l->table, axis, s, dps, n, t_ns);
}

EXPORT void bridge_axis(const struct lab *l, unsigned axis, int64_t t_ns, double out[3])
{
    const struct motion_state s = table_axis(&l->table, axis, t_ns);
    out[0] = s.angle_rad;
    out[1] = s.rate_radps;
    out[2] = s.accel_radps2;
}

EXPORT double bridge_readout_deg(const struct lab *l, unsigned axis, int64_t t_ns)
{
    return table_read(&l->table, axis, t_ns).angle_deg;
}

EXPORT void bridge_attitude(struct lab *l, int64_t t_ns, double C_nt[3][3])
{
    const struct pose *p = table_pose(&l->table, t_ns);
    for (unsigned i = 0; i < 3; i++) {
        for (unsigned k = 0; k < 3; k++) C_nt[i][k] = p->C_nb[i][k];
    }
}

EXPORT void bridge_head(struct lab *l, double deg, int face, int64_t t_ns)
{
    head_turn(&l->head, deg, t_ns);
    head_mount(&l->head, (enum head_face)face, t_ns);
}

static struct lab_mounting mounting_of(const double mounting[7])
{
    return (struct lab_mounting){
        (enum lab_mount)mounting[0], {mounting[1], mounting[2], mounting[3]}, {mounting[4], mounting[5], mounting[6]}};
}

/* mounting: mount, lever arm m, misalignment rad. out: f, w */
EXPORT void bridge_kinematics(struct lab *l, const double mounting[7], const double at_m[3], int64_t t_ns,
                              double out[6])
{
    const struct lab_mounting s = mounting_of(mounting);
    struct kinematics motion;
    lab_kinematics(l, &s, at_m, t_ns, &motion);
    for (unsigned k = 0; k < 3; k++) {
        out[k] = motion.f_mps2[k];
        out[3 + k] = motion.w_radps[k];
    }
}

/* An accelerometer of a unit, model (1): volts. k in V per m/s^2. */
EXPORT double bridge_accelerometer(struct lab *l, const double mounting[7], const double at_m[3], double u0_v,
                                   const double k[3], int64_t t_ns)
{
    const struct lab_mounting s = mounting_of(mounting);
    const struct mems_cfg c = {.u0_v = u0_v, .k_v_per_mps2 = {k[0], k[1], k[2]}};
    struct mems m;
    double a_mps2[3];
    lab_sensor_mps2(l, &s, at_m, 1.0, 0.0, t_ns, a_mps2);
    mems_init(&m, &c, draws_of(0, 0, "mems"), draws_of(0, 0, "slow"));
    return mems_true_v(&m, a_mps2, t_ns);
}

/* of: the fields of struct cvg_dps in order. */
EXPORT struct cvg *bridge_gyro(const struct cvg_dps *of, double g_mps2, uint64_t seed)
{
    struct cvg *c = malloc(sizeof *c);
    if (c) cvg_init(c, of, g_mps2, draws_of(seed, 1, "cvg.x"), draws_of(seed, 1, "cvg.slow.x"));
    return c;
}

EXPORT void bridge_gyro_free(struct cvg *c)
{
    free(c);
}

/* w, a on its axes; the element as warm. */
EXPORT double bridge_gyro_true_v(struct cvg *c, const double w_radps[3], const double a_mps2[3], double degc)
{
    c->temp_degc = degc;
    return cvg_true_v(c, w_radps, a_mps2);
}

/* Mean of n looks every_ns apart of a gyro on the table, from t_ns on, and how far its zero was moved: the mean of that. */
EXPORT void bridge_gyro_block(struct cvg *c, struct lab *l, const double mounting[7], int64_t t_ns, int64_t every_ns,
                              unsigned n, double out[2])
{
    static const double centre_m[3];
    const struct lab_mounting s = mounting_of(mounting);
    out[0] = out[1] = 0.0;
    for (unsigned i = 0; i < n; i++, t_ns += every_ns) {
        struct kinematics kin;
        lab_kinematics(l, &s, centre_m, t_ns, &kin);
        const double a_mps2[3] = {-kin.f_mps2[0], -kin.f_mps2[1], -kin.f_mps2[2]};
        out[0] += cvg_out_v(c, kin.w_radps, a_mps2, t_ns, every_ns) / n;
        out[1] += cvg_zero_moved_v(c, t_ns) / n;
    }
}

struct oven {
    struct chamber chamber;
    struct chamber_body body;
};

EXPORT struct oven *bridge_oven(double start_degc, double heating, double cooling, double tau_case_s,
                                double tau_element_s)
{
    struct oven *o = malloc(sizeof *o);
    struct chamber_cfg c = chamber_default();
    c.present = true;
    c.start_degc = start_degc;
    c.heating_max_k_per_min = heating;
    c.cooling_max_k_per_min = cooling;
    c.ramp_k_per_min = 1.0;
    c.tau_case_s = 0.0; /* 0: no lag, for those who ask for one */
    c.tau_element_s = 0.0;
    if (!o) return NULL;
    chamber_init(&o->chamber, &c);
    chamber_put_in(&o->chamber, &o->body, tau_case_s, tau_element_s);
    return o;
}

EXPORT void bridge_oven_free(struct oven *o)
{
    free(o);
}

EXPORT int bridge_oven_set(struct oven *o, double degc, int64_t t_ns)
{
    return (int)chamber_set(&o->chamber, degc, t_ns);
}

EXPORT int bridge_oven_ramp(struct oven *o, double k_per_min, int64_t t_ns)
{
    return (int)chamber_ramp(&o->chamber, k_per_min, t_ns);
}

EXPORT void bridge_oven_degc(const struct oven *o, int64_t t_ns, double out[3])
{
    out[0] = chamber_air_degc(&o->chamber, t_ns);
    out[1] = chamber_case_degc(&o->chamber, &o->body, t_ns);
    out[2] = chamber_element_degc(&o->chamber, &o->body, t_ns);
}

/* A sensor at rest, looked at every dt_ns, n times. terms: white density, B, K, R, q */
EXPORT void bridge_noise(const double terms[5], uint64_t seed, int64_t dt_ns, unsigned n, double *out)
{
    const struct mems_cfg c = {
        .noise_v_rthz = terms[0],
        .drift_v_per_s = terms[3],
        .slow = {.bias_instability_u = terms[1], .walk_u_rts = terms[2], .quantum_u = terms[4]},
    };
    const double still[3] = {0.0, 0.0, 0.0};
    struct mems m;
    mems_init(&m, &c, draws_of(seed, 1, "mems.x"), draws_of(seed, 1, "mems.slow.x"));
    for (unsigned i = 0; i < n; i++) {
        const int64_t t_ns = (int64_t)(i + 1) * dt_ns;
        mems_out_row_v(&m, still, 1, &(struct looks){&t_ns, 1, dt_ns}, &out[i]);
    }
}

/* The same of noise.h alone, in its own terms: B, K, R */
EXPORT void bridge_slow(const double terms[3], uint64_t seed, int64_t dt_ns, unsigned n, double *out)
{
    const struct noise_cfg c = {terms[0], terms[1], terms[2], 0.0};
    struct noise noise;
    noise_init(&noise, &c, draws_of(seed, 1, "slow"));
    for (unsigned i = 0; i < n; i++) out[i] = noise_slow_u(&noise, (int64_t)(i + 1) * dt_ns);
}

EXPORT struct supply *bridge_supply(double slew_v_per_s)
{
    struct supply *s = malloc(sizeof *s);
    struct supply_cfg c = supply_default();
    c.present = true;
    c.slew_v_per_s = slew_v_per_s;
    if (s) supply_init(s, &c);
    return s;
}

EXPORT void bridge_supply_free(struct supply *s)
{
    free(s);
}

EXPORT int bridge_supply_set(struct supply *s, double volt_v, int64_t t_ns)
{
    return (int)supply_set(s, volt_v, t_ns);
}

EXPORT int bridge_supply_ripple(struct supply *s, double amplitude_v, double hz, int64_t t_ns)
{
    return (int)supply_ripple(s, amplitude_v, hz, t_ns);
}

EXPORT int bridge_supply_dip(struct supply *s, double drop_v, int64_t from_ns, int64_t for_ns)
{
    return (int)supply_dip(s, drop_v, from_ns, for_ns, 0);
}

EXPORT double bridge_supply_volts(const struct supply *s, int64_t t_ns)
{
    return supply_volts(s, t_ns);
}

EXPORT int64_t bridge_supply_next(const struct supply *s, int fed, int64_t from_ns)
{
    return supply_next_ns(s, fed != 0, from_ns);
}
