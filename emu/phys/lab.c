#include "phys/lab.h"

#include <assert.h>
#include <string.h>

struct lab_cfg lab_default(void)
{
    return (struct lab_cfg){
        .site = {.g_mps2 = 9.81},
        .table = table_default(0),
        .chamber = chamber_default(),
        .supply = supply_default(),
        .platform = platform_default(),
        .magnetic = magnetic_default(),
        .vehicle = vehicle_default(),
        .flight = flight_default(),
    };
}

static void set_tilt(struct lab_tilt *t, const double misalignment_rad[3])
{
    memcpy(t->misalignment_rad, misalignment_rad, sizeof t->misalignment_rad);
    pose_start(&t->pose, &(struct site){0});
    pose_tilt(&t->pose, misalignment_rad);
}

static const struct pose *tilt_of(struct lab *l, const struct lab_mounting *mounting)
{
    const double *askew = mounting->misalignment_rad, *was = l->tilt.misalignment_rad;
    if (askew[0] != was[0] || askew[1] != was[1] || askew[2] != was[2]) set_tilt(&l->tilt, askew);
    return &l->tilt.pose;
}

/* The scenario has proved that the legs can be flown. */
static void init_flight(struct lab *l, const struct lab_cfg *cfg)
{
    struct flight_error e;
    l->aircraft.t_ns = -1;
    if (!cfg->flight.present) return;
    const bool flies = flight_init(&l->flight, &cfg->flight, &cfg->site, &e);
    assert(flies);
    (void)flies;
}

void lab_init(struct lab *l, const struct lab_cfg *cfg, uint64_t seed)
{
    *l = (struct lab){.site = cfg->site};
    head_init(&l->head, &cfg->head, &cfg->site, rng_stream(seed, 0, "head"));
    table_init(&l->table, &cfg->table, &cfg->site, seed);
    chamber_init(&l->chamber, &cfg->chamber);
    supply_init(&l->supply, &cfg->supply);
    pose_start(&l->bench, &cfg->site);
    set_tilt(&l->tilt, (const double[3]){0.0, 0.0, 0.0});
    platform_init(&l->platform, &cfg->platform, &cfg->vehicle, &cfg->site, seed);
    magnetic_init(&l->magnetic, &cfg->magnetic, seed);
    init_flight(l, cfg);
}

void lab_reseed(struct lab *l, uint64_t seed, int64_t t_ns)
{
    rng_reseed(&l->head.error, seed);
    l->table.seed = seed;
    if (l->platform.cfg.present) platform_reseed(&l->platform, seed, t_ns);
    magnetic_reseed(&l->magnetic, seed);
}

static bool is_zero(const double v[3])
{
    return v[0] == 0.0 && v[1] == 0.0 && v[2] == 0.0;
}

bool lab_is_centred(const struct lab_mounting *mounting, const double at_m[3])
{
    return is_zero(at_m) && is_zero(mounting->lever_m);
}

/* How the case is in the mount: the face of the head or the tilt of the level sensors, then the misalignment. */
static struct pose case_in_mount(struct lab *l, const struct lab_mounting *mounting, int64_t t_ns)
{
    struct pose p;
    if (mounting->on != LAB_PLATFORM && mounting->on != LAB_HEAD) return *tilt_of(l, mounting);
    pose_start(&p, &(struct site){0});
    if (mounting->on == LAB_PLATFORM) p = *platform_level(&l->platform, t_ns);
    if (mounting->on == LAB_HEAD) pose_turn(&p, POSE_X, head_face_rad(head_face(&l->head, t_ns)), 0.0, 0.0);
    pose_tilt(&p, mounting->misalignment_rad);
    return p;
}

static void head_pose(const struct lab *l, int64_t t_ns, struct pose *p)
{
    const struct motion_state s = head_motion(&l->head, t_ns);
    *p = l->bench;
    pose_turn(p, POSE_X, -HEAD_QUARTER_RAD, 0.0, 0.0); /* x ahead, y up, z to the right: gravity of head.h at angle 0 */
    pose_turn(p, POSE_Z, s.angle_rad, s.rate_radps, s.accel_radps2);
}

/* At the centre exactly; a lever arm adds the centripetal part, with the rate as if it were constant. */
static void platform_kinematics(struct platform *platform, const double r_m[3], int64_t t_ns, struct kinematics *out)
{
    struct pose p;
    double f_mps2[3];
    platform_pose(platform, t_ns, &p);
    pose_force_mps2(&p, 0.0, r_m, out->f_mps2);
    platform_force_mps2(platform, t_ns, f_mps2);
    for (unsigned k = 0; k < 3; k++) out->f_mps2[k] += f_mps2[k];
    memcpy(out->w_radps, p.w_ib_b_radps, sizeof out->w_radps);
}

const struct flight_state *lab_aircraft(struct lab *l, int64_t t_ns)
{
    if (t_ns != l->aircraft.t_ns) flight_at(&l->flight, t_ns, &l->aircraft.at);
    l->aircraft.t_ns = t_ns;
    return &l->aircraft.at;
}

static void aircraft_kinematics(const struct flight_state *s, const double r_m[3], struct kinematics *out)
{
    pose_force_mps2(&s->pose, 0.0, r_m, out->f_mps2);
    for (unsigned k = 0; k < 3; k++) out->f_mps2[k] += s->f_b_mps2[k];
    memcpy(out->w_radps, s->pose.w_ib_b_radps, sizeof out->w_radps);
}

/* In the mount's axes, at r_m from the instrument's centre. */
static void mount_kinematics(struct lab *l, enum lab_mount on, const double r_m[3], int64_t t_ns,
                             struct kinematics *out)
{
    struct pose turned;
    const struct pose *p = &l->bench;
    if (on == LAB_PLATFORM) {
        platform_kinematics(&l->platform, r_m, t_ns, out);
        return;
    }
    if (on == LAB_FLIGHT) {
        aircraft_kinematics(lab_aircraft(l, t_ns), r_m, out);
        return;
    }
    if (on == LAB_TABLE) p = table_pose(&l->table, t_ns);
    if (on == LAB_HEAD) {
        head_pose(l, t_ns, &turned);
        p = &turned;
    }
    pose_force_mps2(p, l->site.g_mps2, r_m, out->f_mps2);
    memcpy(out->w_radps, p->w_ib_b_radps, sizeof out->w_radps);
}

/* The same at at_m from the unit's origin, in the axes of its case; returns how these are in the mount's. */
static struct pose unit_kinematics(struct lab *l, const struct lab_mounting *mounting, const double at_m[3],
                                   int64_t t_ns, struct kinematics *out)
{
    const struct pose in_mount = case_in_mount(l, mounting, t_ns);
    double r_m[3];
    pose_out_of(&in_mount, at_m, r_m);
    for (unsigned k = 0; k < 3; k++) r_m[k] += mounting->lever_m[k];
    mount_kinematics(l, mounting->on, r_m, t_ns, out);
    return in_mount;
}

void lab_kinematics(struct lab *l, const struct lab_mounting *mounting, const double at_m[3], int64_t t_ns,
                    struct kinematics *out)
{
    const struct pose in_mount = unit_kinematics(l, mounting, at_m, t_ns, out);
    pose_into(&in_mount, out->f_mps2, out->f_mps2);
    pose_into(&in_mount, out->w_radps, out->w_radps);
}

int64_t lab_smooth_ns(const struct lab *l, const struct lab_mounting *mounting, int64_t t_ns)
{
    switch (mounting->on) {
    case LAB_TABLE:
        return table_smooth_ns(&l->table, t_ns);
    case LAB_HEAD:
        return head_smooth_ns(&l->head, t_ns);
    case LAB_PLATFORM:
        return platform_smooth_ns(&l->platform, t_ns);
    case LAB_FLIGHT:
        return flight_smooth_ns(&l->flight, t_ns);
    case LAB_FIXED:
        break;
    }
    return INT64_MAX;
}

/* f in the mount's axes: without lever arms the platform's own arithmetic, else by way of the poses. */
static void mount_force_mps2(struct lab *l, const struct lab_mounting *mounting, const double at_m[3], int64_t t_ns,
                             double f_mps2[3])
{
    struct kinematics kin;
    if (mounting->on == LAB_PLATFORM && lab_is_centred(mounting, at_m)) {
        platform_force_mps2(&l->platform, t_ns, f_mps2);
        return;
    }
    unit_kinematics(l, mounting, at_m, t_ns, &kin);
    memcpy(f_mps2, kin.f_mps2, sizeof kin.f_mps2);
}

static void apply_misalignment(struct lab *l, const struct lab_mounting *mounting, double a_mps2[3])
{
    pose_into(tilt_of(l, mounting), a_mps2, a_mps2);
}

/* -f in the mount's axes. */
static void mount_gravity_mps2(struct lab *l, const struct lab_sensor *s, int64_t t_ns, double a_mps2[3])
{
    mount_force_mps2(l, s->mounting, s->at_m, t_ns, a_mps2);
    for (unsigned k = 0; k < 3; k++) a_mps2[k] = -a_mps2[k];
    if (s->mounting->on == LAB_PLATFORM) pose_into(platform_level(&l->platform, t_ns), a_mps2, a_mps2);
}

static unsigned compute_row(struct lab *l, const struct lab_sensor *s, const int64_t *t_ns, unsigned n,
                            double a_mps2[][3])
{
    if (s->mounting->on == LAB_HEAD && lab_is_centred(s->mounting, s->at_m))
        return head_gravity_row_mps2(&l->head, t_ns, n, a_mps2);
    if (s->mounting->on == LAB_FIXED) n = 1;
    for (unsigned i = 0; i < n; i++) mount_gravity_mps2(l, s, t_ns[i], a_mps2[i]);
    return n;
}

static bool is_kept(const struct lab_row *row, enum lab_mount on, const int64_t *t_ns, unsigned n)
{
    return row->n == n && row->on == on && memcmp(row->t_ns, t_ns, n * sizeof *t_ns) == 0;
}

static unsigned mount_row(struct lab *l, const struct lab_sensor *s, const int64_t *t_ns, unsigned n,
                          double a_mps2[][3])
{
    struct lab_row *row = &l->row;
    const enum lab_mount on = s->mounting->on;
    const bool shared = n > 1 && n <= LAB_ROW && lab_is_centred(s->mounting, s->at_m);
    if (shared && is_kept(row, on, t_ns, n)) {
        memcpy(a_mps2, row->a_mps2, n * sizeof *a_mps2);
        return n;
    }
    const unsigned written = compute_row(l, s, t_ns, n, a_mps2);
    if (!shared || written < n) return written;
    row->on = on;
    row->n = n;
    memcpy(row->t_ns, t_ns, n * sizeof *t_ns);
    memcpy(row->a_mps2, a_mps2, n * sizeof *a_mps2);
    return n;
}

unsigned lab_sensor_row_mps2(struct lab *l, const struct lab_sensor *s, const int64_t *t_ns, unsigned n,
                             double a_mps2[][3])
{
    const struct lab_mounting *m = s->mounting;
    const bool square = is_zero(m->misalignment_rad);
    n = mount_row(l, s, t_ns, n, a_mps2);
    for (unsigned i = 0; i < n; i++) {
        const enum head_face face = m->on == LAB_HEAD ? head_face(&l->head, t_ns[i]) : HEAD_DIRECT;
        head_sensor_mps2(face, s->cos_alpha0, s->sin_alpha0, a_mps2[i], a_mps2[i]);
        if (!square) apply_misalignment(l, m, a_mps2[i]);
    }
    return n;
}

void lab_sensor_mps2(struct lab *l, const struct lab_mounting *mounting, const double at_m[3], double cos_alpha0,
                     double sin_alpha0, int64_t t_ns, double a_mps2[3])
{
    double row[1][3];
    const struct lab_sensor s = {mounting, at_m, cos_alpha0, sin_alpha0};
    (void)lab_sensor_row_mps2(l, &s, &t_ns, 1, row);
    memcpy(a_mps2, row[0], sizeof row[0]);
}

static const char *const mounts[] = {[LAB_HEAD] = "head",
                                     [LAB_TABLE] = "table",
                                     [LAB_FIXED] = "fixed",
                                     [LAB_PLATFORM] = "platform",
                                     [LAB_FLIGHT] = "flight"};

const char *lab_mount_name(enum lab_mount on)
{
    return (unsigned)on < sizeof mounts / sizeof *mounts ? mounts[on] : NULL;
}
