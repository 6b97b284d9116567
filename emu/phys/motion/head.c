#include "phys/motion/head.h"

#include "base/detmath.h"
#include "base/sched.h"

#include <string.h>

void head_init(struct head *h, const struct head_cfg *cfg, const struct site *site, struct rng error)
{
    *h = (struct head){.cfg = *cfg, .site = *site, .error = error};
}

static double quantise_rad(const struct head_cfg *c, double angle_rad)
{
    return det_quantise(angle_rad, c->resolution_arcsec * RAD_PER_ARCSEC);
}

static double periodic_rad(const struct head_cfg *c, double angle_rad)
{
    const double order = c->periodic_order ? (double)c->periodic_order : 1.0;
    return c->periodic_arcsec * RAD_PER_ARCSEC * det_sin(order * angle_rad);
}

static double draw_rad(struct head *h, double arcsec_rms)
{
    return arcsec_rms > 0.0 ? arcsec_rms * RAD_PER_ARCSEC * rng_gauss(&h->error) : 0.0;
}

/* Smooth start and stop: 3 x^2 - 2 x^3. */
static double turned_rad(const struct head *h, double from_rad, double to_rad, int64_t t_ns)
{
    if (t_ns >= h->end_ns) return to_rad;
    if (t_ns <= h->start_ns) return from_rad;
    const double x = (double)(t_ns - h->start_ns) / (double)(h->end_ns - h->start_ns);
    return from_rad + (to_rad - from_rad) * x * x * (3.0 - 2.0 * x);
}

/* Angle of the mount alone. */
static double mount_angle_rad(const struct head *h, int64_t t_ns)
{
    return turned_rad(h, h->from_rad, h->to_rad, t_ns);
}

static double slip_rad(const struct head *h, int64_t t_ns)
{
    return turned_rad(h, h->slip_from_rad, h->slip_to_rad, t_ns);
}

/* What the faults make of a turn. */
static void hinder_turn(struct head *h)
{
    const double way_rad = h->to_rad - h->from_rad - h->slip_from_rad;
    h->slip_to_rad = h->slip_step_rad == 0.0 ? 0.0 : h->slip_from_rad + (way_rad < 0.0 ? -1.0 : 1.0) * h->slip_step_rad;
    h->to_rad -= h->slip_to_rad;
    if (!h->stuck) return;
    h->to_rad = h->from_rad;
    h->slip_to_rad = h->slip_from_rad;
}

void head_turn(struct head *h, double angle_deg, int64_t t_ns)
{
    const double slipped_rad = slip_rad(h, t_ns);
    h->from_rad = mount_angle_rad(h, t_ns);
    h->slip_from_rad = slipped_rad;
    h->scale_rad = quantise_rad(&h->cfg, angle_deg * RAD_PER_DEG);
    h->setting_rad = draw_rad(h, h->cfg.setting_error_arcsec_rms);
    h->to_rad = h->scale_rad + h->setting_rad + periodic_rad(&h->cfg, h->scale_rad);
    hinder_turn(h);
    h->start_ns = t_ns;
    h->end_ns = t_ns + (int64_t)(h->cfg.turn_s * (double)NS_PER_S + 0.5);
    h->rest_known = false;
}

void head_stick(struct head *h, bool stuck, int64_t t_ns)
{
    h->stuck = stuck;
    if (!stuck || head_at_rest(h, t_ns)) return;
    const double angle_rad = mount_angle_rad(h, t_ns), slipped_rad = slip_rad(h, t_ns);
    h->from_rad = h->to_rad = angle_rad;
    h->slip_from_rad = h->slip_to_rad = slipped_rad;
    h->end_ns = t_ns;
    h->rest_known = false;
}

void head_slip(struct head *h, double step_deg)
{
    h->slip_step_rad = step_deg * RAD_PER_DEG;
}

void head_mount(struct head *h, enum head_face face, int64_t t_ns)
{
    h->face_before = h->face;
    h->mount_before_rad = h->mount_rad;
    h->face = face;
    h->face_ns = t_ns;
    h->mount_rad = draw_rad(h, h->cfg.mount_error_arcsec_rms);
    h->rest_known = false;
}

enum head_face head_face(const struct head *h, int64_t t_ns)
{
    return t_ns < h->face_ns ? h->face_before : h->face;
}

bool head_at_rest(const struct head *h, int64_t t_ns)
{
    return t_ns >= h->end_ns;
}

int64_t head_rest_ns(const struct head *h)
{
    return h->end_ns;
}

int64_t head_smooth_ns(const struct head *h, int64_t t_ns)
{
    if (t_ns < h->start_ns) return h->start_ns;
    return t_ns < h->end_ns ? h->end_ns : INT64_MAX;
}

double head_angle_rad(const struct head *h, int64_t t_ns)
{
    return mount_angle_rad(h, t_ns) + (t_ns < h->face_ns ? h->mount_before_rad : h->mount_rad);
}

struct motion_state head_motion(const struct head *h, int64_t t_ns)
{
    struct motion_state s = {.angle_rad = head_angle_rad(h, t_ns)};
    if (t_ns < h->end_ns && t_ns >= h->start_ns) {
        const double turn_s = (double)(h->end_ns - h->start_ns) / (double)NS_PER_S;
        const double way_rad = h->to_rad - h->from_rad;
        const double x = (double)(t_ns - h->start_ns) / (double)(h->end_ns - h->start_ns);
        s.rate_radps = way_rad * 6.0 * x * (1.0 - x) / turn_s;
        s.accel_radps2 = way_rad * (6.0 - 12.0 * x) / (turn_s * turn_s);
    }
    return s;
}

/* The scale carries its own periodic error: it shows what the operator set, off by the setting error. */
double head_read_deg(const struct head *h, int64_t t_ns)
{
    const double angle_rad = mount_angle_rad(h, t_ns) + slip_rad(h, t_ns);
    return quantise_rad(&h->cfg, angle_rad - periodic_rad(&h->cfg, angle_rad)) / RAD_PER_DEG;
}

static bool holds_from(const struct head *h, int64_t t_ns)
{
    return t_ns >= h->end_ns && t_ns >= h->face_ns;
}

static void set_gravity(const struct head *h, struct det_pair alpha, double a_m_mps2[3])
{
    a_m_mps2[0] = -h->site.g_mps2 * alpha.sin;
    a_m_mps2[1] = -h->site.g_mps2 * alpha.cos;
    a_m_mps2[2] = 0.0;
}

/* Exact where it rests, by way of the nearest kept angle where it moves: a function of the instant either way. */
void head_gravity_mps2(struct head *h, int64_t t_ns, double a_m_mps2[3])
{
    if (!holds_from(h, t_ns)) {
        set_gravity(h, det_sin_cos_near(&h->near, head_angle_rad(h, t_ns)), a_m_mps2);
        return;
    }
    if (!h->rest_known) {
        set_gravity(h, det_sin_cos(head_angle_rad(h, t_ns)), h->rest_g_mps2);
        h->rest_known = true;
    }
    memcpy(a_m_mps2, h->rest_g_mps2, sizeof h->rest_g_mps2);
}

unsigned head_gravity_row_mps2(struct head *h, const int64_t *t_ns, unsigned n, double a_m_mps2[][3])
{
    if (holds_from(h, t_ns[0])) n = 1;
    for (unsigned i = 0; i < n; i++) head_gravity_mps2(h, t_ns[i], a_m_mps2[i]);
    return n;
}

/* Rows: which mount axis a sensor axis lies along, and its sense. A face is a rotation about Ox: determinant +1. */
struct face_axis {
    unsigned along;
    double sense;
};

static const struct {
    const char *name;
    struct face_axis y, z;
    double quarters; /* the rotation */
} faces[HEAD_FACES] = {
    [HEAD_DIRECT] = {"direct", {1, 1.0}, {2, 1.0}, 0.0},
    [HEAD_REVERSED] = {"reversed", {1, -1.0}, {2, -1.0}, 2.0},
    [HEAD_SIDE] = {"side", {2, -1.0}, {1, 1.0}, -1.0},
    [HEAD_SIDE_REVERSED] = {"side_reversed", {2, 1.0}, {1, -1.0}, 1.0},
};

void head_sensor_mps2(enum head_face face, double cos_alpha0, double sin_alpha0, const double a_m_mps2[3],
                      double a_s_mps2[3])
{
    /* sin(alpha + alpha0) and cos(alpha + alpha0) from those of alpha */
    const double tilted[3] = {a_m_mps2[0] * cos_alpha0 + a_m_mps2[1] * sin_alpha0,
                              a_m_mps2[1] * cos_alpha0 - a_m_mps2[0] * sin_alpha0, a_m_mps2[2]};
    a_s_mps2[0] = tilted[0];
    a_s_mps2[1] = faces[face].y.sense * tilted[faces[face].y.along];
    a_s_mps2[2] = faces[face].z.sense * tilted[faces[face].z.along];
}

double head_face_rad(enum head_face face)
{
    return faces[face].quarters * HEAD_QUARTER_RAD;
}

const char *head_face_name(enum head_face face)
{
    return (unsigned)face < HEAD_FACES ? faces[face].name : NULL;
}
