#include "base/detmath.h"

#include <assert.h>
#include <math.h>
#include <stdint.h>

#define LN2_HI 0x1.62e42fefa0000p-1 /* low 20 bits zero: k * LN2_HI is exact for |k| < 2^20 */
#define LN2_LO 0x1.cf79abc9e3b3ap-40

/* log(x) = k ln2 + 2 atanh(s), s = (m - 1)/(m + 1), m in [1/sqrt 2, sqrt 2): |s| < 0.1716, so s^23 is below 1e-18. */
double det_log(double x)
{
    assert(x > 0.0);
    int k;
    double m = frexp(x, &k);
    if (m < 0.70710678118654752440) {
        m *= 2.0;
        k--;
    }
    const double f = m - 1.0;
    const double s = f / (2.0 + f);
    const double z = s * s;
    static const double odd[] = {1.0 / 23, 1.0 / 21, 1.0 / 19, 1.0 / 17, 1.0 / 15, 1.0 / 13,
                                 1.0 / 11, 1.0 / 9,  1.0 / 7,  1.0 / 5,  1.0 / 3};
    double sum = 0.0;
    for (unsigned i = 0; i < sizeof odd / sizeof *odd; i++) sum = (sum + odd[i]) * z;
    return (double)k * LN2_HI + (2.0 * s + (2.0 * s * sum + (double)k * LN2_LO));
}

/* exp(x) = 2^k exp(r), |r| <= ln2/2, Taylor to r^17. */
double det_exp(double x)
{
    assert(x >= -700.0 && x <= 700.0);
    const double k = floor(x * 1.44269504088896340736 + 0.5);
    const double r = (x - k * LN2_HI) - k * LN2_LO;
    double sum = 1.0;
    for (int n = 17; n >= 1; n--) sum = 1.0 + sum * r / n;
    return ldexp(sum, (int)k);
}

/* pi/2 in three parts, each of the first two with 20 zero low bits. */
#define PIO2_1 0x1.921fb54400000p+0
#define PIO2_2 0x1.0b4611a600000p-34
#define PIO2_3 0x1.3198a2e037073p-69

static double poly_sin(double r)
{
    const double z = r * r;
    double sum = 1.0;
    for (int n = 21; n >= 3; n -= 2) sum = 1.0 - sum * z / (double)(n * (n - 1));
    return r * sum;
}

static double poly_cos(double r)
{
    const double z = r * r;
    double sum = 1.0;
    for (int n = 22; n >= 2; n -= 2) sum = 1.0 - sum * z / (double)(n * (n - 1));
    return sum;
}

/* Two doubles side by side: one division does for both. */
typedef double both __attribute__((vector_size(16)));

/* poly_sin() and poly_cos(), a step of each at a time. */
static struct det_pair poly_pair(double r)
{
    static const both divisor[] = {{21 * 20, 20 * 19}, {19 * 18, 18 * 17}, {17 * 16, 16 * 15}, {15 * 14, 14 * 13},
                                   {13 * 12, 12 * 11}, {11 * 10, 10 * 9},  {9 * 8, 8 * 7},     {7 * 6, 6 * 5},
                                   {5 * 4, 4 * 3},     {3 * 2, 2 * 1}};
    const double z = r * r;
    both sum = {1.0, 1.0 - z / (double)(22 * 21)};
    for (unsigned i = 0; i < sizeof divisor / sizeof *divisor; i++) sum = 1.0 - sum * z / divisor[i];
    return (struct det_pair){r * sum[0], sum[1]};
}

/* x - k pi/2, at most pi/4 */
static double reduced_rad(double x_rad, int64_t *k)
{
    assert(fabs(x_rad) <= 1e6);
    const double n = floor(x_rad * 0.63661977236758134308 + 0.5);
    *k = (int64_t)n;
    return ((x_rad - n * PIO2_1) - n * PIO2_2) - n * PIO2_3;
}

/* sin(x + quarter pi/2) */
static double sin_quarter(double x_rad, int64_t quarter)
{
    int64_t k;
    const double r = reduced_rad(x_rad, &k);
    const int64_t q = (k + quarter) & 3;
    const double v = (q & 1) ? poly_cos(r) : poly_sin(r);
    return (q & 2) ? -v : v;
}

double det_sin(double x_rad)
{
    return sin_quarter(x_rad, 0);
}

double det_cos(double x_rad)
{
    return sin_quarter(x_rad, 1);
}

struct det_pair det_sin_cos(double x_rad)
{
    if (x_rad == 0.0) return (struct det_pair){x_rad, 1.0}; /* a level vehicle, a head at its mark */
    int64_t k;
    const struct det_pair p = poly_pair(reduced_rad(x_rad, &k));
    const double s = (k & 1) ? p.cos : p.sin;
    const double c = (k & 1) ? p.sin : p.cos;
    return (struct det_pair){(k & 2) ? -s : s, ((k + 1) & 2) ? -c : c};
}

#define ROUND_DOUBLE 0x1.8p52 /* adding and taking it off rounds to an integer, without a call of floor() */

/* |d| <= 1/128: the sine's next term is below 4e-19, the cosine's below 4e-22. */
struct det_pair det_sin_cos_near(struct det_near *near, double x_rad)
{
    const double at_rad = ((x_rad * 64.0 + ROUND_DOUBLE) - ROUND_DOUBLE) * 0x1p-6;
    if (at_rad != near->kept_rad || near->kept.cos == 0.0) {
        near->kept_rad = at_rad;
        near->kept = det_sin_cos(at_rad);
    }
    const struct det_pair k = near->kept;
    const double d = x_rad - at_rad;
    const double z = d * d;
    const double sin_d = d - d * z * (1.0 / 6 - z * (1.0 / 120));
    const double versine_d = z * (0.5 - z * (1.0 / 24 - z * (1.0 / 720)));
    return (struct det_pair){k.sin + (k.cos * sin_d - k.sin * versine_d), k.cos - (k.sin * sin_d + k.cos * versine_d)};
}

/* 0 <= t <= 1. atan t = atan c + atan((t - c)/(1 + t c)) with c the nearest quarter: |s| <= 1/8, s^19/19 is below 1e-18. */
static double atan_unit(double t)
{
    static const double quarter[][2] = {{0.0, 0.0},
                                        {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
                                        {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
                                        {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
                                        {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}};
    const int j = (int)(4.0 * t + 0.5);
    const double c = 0.25 * (double)j;
    const double s = (t - c) / (1.0 + t * c);
    const double z = s * s;
    double sum = 0.0;
    for (int n = 17; n >= 3; n -= 2) sum = (1.0 / (double)n - sum) * z;
    return quarter[j][0] + (quarter[j][1] + (s - s * sum));
}

double det_atan2(double y, double x)
{
    const double ax = fabs(x);
    const double ay = fabs(y);
    if (ax == 0.0 && ay == 0.0) return 0.0;
    double a = ay <= ax ? atan_unit(ay / ax) : (PIO2_1 - atan_unit(ax / ay)) + PIO2_2;
    if (x < 0.0) a = (2.0 * PIO2_1 - a) + 2.0 * PIO2_2;
    return y < 0.0 ? -a : a;
}

double det_wrap_rad(double angle_rad)
{
    return angle_rad - TURN_RAD * ceil(angle_rad / TURN_RAD - 0.5);
}

double det_quantise(double x, double step)
{
    return step > 0.0 ? nearbyint(x / step) * step : x;
}
