#include "board/gyro/law.h"

#include "base/detmath.h"
#include "phys/motion/earth.h"

#include <math.h>

#define PI        3.141592653589793238
#define ALIKE_RAD 1e-6 /* half a turn, whatever the rounding */

/* ---- level ---- */

static double clamp_unit(double x)
{
    return fmin(fmax(x, -1.0), 1.0);
}

struct gyro_level gyro_level_of(double y_g, double x_g)
{
    struct gyro_level l = {.sin_b = clamp_unit(y_g)};
    l.cos_b = sqrt(1.0 - l.sin_b * l.sin_b);
    l.sin_g = l.cos_b > 0.0 ? clamp_unit(-x_g / l.cos_b) : 0.0;
    l.cos_g = sqrt(1.0 - l.sin_g * l.sin_g);
    l.beta_rad = det_atan2(l.sin_b, l.cos_b);
    l.gamma_rad = det_atan2(l.sin_g, l.cos_g);
    return l;
}

/* ---- rates ---- */

struct gyro_place gyro_place_of(double latitude_deg, double speed_mps, double track_deg)
{
    const double lat_rad = latitude_deg * RAD_PER_DEG;
    const struct det_pair track = det_sin_cos(track_deg * RAD_PER_DEG), lat = det_sin_cos(lat_rad);
    const double east = speed_mps * track.sin / EARTH_RADIUS_M;
    const double north = speed_mps * track.cos / EARTH_RADIUS_M;
    return (struct gyro_place){.east_radps = -north,
                               .north_radps = EARTH_RATE_RADPS * lat.cos + east,
                               .up_radps = EARTH_RATE_RADPS * lat.sin + east * lat.sin / lat.cos};
}

double gyro_law_level(double m1, const struct gyro_level *l, double up_radps, double turn_radps)
{
    return -m1 * l->beta_rad - (up_radps + turn_radps) * l->cos_b * l->sin_g;
}

double gyro_law_vertical(const struct gyro_level *l, double up_radps, double turn_radps)
{
    return (up_radps + turn_radps) * l->cos_b * l->cos_g;
}

double gyro_law_keep(const struct gyro_level *l, const struct gyro_place *w, double sin_a, double cos_a)
{
    const double along = l->sin_b * l->cos_g;
    return w->east_radps * (cos_a * l->sin_g + sin_a * along) + w->north_radps * (sin_a * l->sin_g - cos_a * along) +
           w->up_radps * l->cos_b * l->cos_g;
}

/* ---- turns ---- */

double gyro_wrap_rad(double a_rad)
{
    const double wrapped = a_rad - 2.0 * PI * floor((a_rad + PI) / (2.0 * PI));
    return wrapped <= -PI ? PI : wrapped;
}

struct gyro_turn gyro_turn_of(double from_rad, double to_rad, double rate_radps, double accel_radps2, int64_t t_ns)
{
    double by = gyro_wrap_rad(to_rad - from_rad);
    if (by < -PI + ALIKE_RAD) by += 2.0 * PI;
    const double way = fabs(by), sign = by < 0.0 ? -1.0 : 1.0;
    double ramp_s = rate_radps / accel_radps2;
    if (rate_radps * ramp_s > way) ramp_s = sqrt(way / accel_radps2); /* never gets to the rate */
    const double top = accel_radps2 * ramp_s;
    return (struct gyro_turn){.from_ns = t_ns,
                              .from_rad = from_rad,
                              .by_rad = by,
                              .rate_radps = sign * top,
                              .accel_radps2 = sign * accel_radps2,
                              .ramp_s = ramp_s,
                              .total_s = way > 0.0 ? ramp_s + way / top : 0.0};
}

double gyro_turn_at(const struct gyro_turn *turn, int64_t t_ns, double *rate_radps)
{
    const double t = (double)(t_ns - turn->from_ns) * 1e-9, left = turn->total_s - t;
    *rate_radps = 0.0;
    if (t <= 0.0) return turn->from_rad;
    if (left <= 0.0) return turn->from_rad + turn->by_rad;
    if (t < turn->ramp_s) {
        *rate_radps = turn->accel_radps2 * t;
        return turn->from_rad + 0.5 * *rate_radps * t;
    }
    if (left < turn->ramp_s) {
        *rate_radps = turn->accel_radps2 * left;
        return turn->from_rad + turn->by_rad - 0.5 * *rate_radps * left;
    }
    *rate_radps = turn->rate_radps;
    return turn->from_rad + turn->rate_radps * (t - 0.5 * turn->ramp_s);
}
