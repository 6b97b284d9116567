#include "base/rng.h"

#include "base/detmath.h"

#include <math.h>

static uint64_t splitmix64(uint64_t *x)
{
    uint64_t z = (*x += UINT64_C(0x9E3779B97F4A7C15));
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

/* FNV-1a: only spreads the names, splitmix64 does the mixing. */
static uint64_t hash_name(const char *name)
{
    uint64_t h = UINT64_C(0xCBF29CE484222325);
    for (; *name; name++) h = (h ^ (uint8_t)*name) * UINT64_C(0x100000001B3);
    return h;
}

struct rng rng_stream(uint64_t seed, uint64_t unit, const char *source)
{
    uint64_t x = seed;
    x = splitmix64(&x) ^ unit;
    x = splitmix64(&x) ^ hash_name(source);
    struct rng r;
    for (int i = 0; i < 4; i++) r.s[i] = splitmix64(&x);
    return r;
}

void rng_reseed(struct rng *r, uint64_t seed)
{
    *r = rng_stream(seed, r->s[0] ^ r->s[3], "reseeded");
}

static double uniform_of(uint64_t u)
{
    return ((double)(u >> 12) + 0.5) * 0x1p-52;
}

double rng_uniform(struct rng *r)
{
    return uniform_of(rng_u64(r));
}

static double poly_ratio(const double *num, const double *den, double x)
{
    const double n =
        ((((((num[7] * x + num[6]) * x + num[5]) * x + num[4]) * x + num[3]) * x + num[2]) * x + num[1]) * x + num[0];
    const double d =
        ((((((den[6] * x + den[5]) * x + den[4]) * x + den[3]) * x + den[2]) * x + den[1]) * x + den[0]) * x + 1.0;
    return n / d;
}

/* AS 241 PPND16, relative error about 1e-16. Denominators lack their constant term 1. */
static double inverse_normal(double p)
{
    static const double a[8] = {3.3871328727963666080e0,  1.3314166789178437745e+2, 1.9715909503065514427e+3,
                                1.3731693765509461125e+4, 4.5921953931549871457e+4, 6.7265770927008700853e+4,
                                3.3430575583588128105e+4, 2.5090809287301226727e+3};
    static const double b[7] = {4.2313330701600911252e+1, 6.8718700749205790830e+2, 5.3941960214247511077e+3,
                                2.1213794301586595867e+4, 3.9307895800092710610e+4, 2.8729085735721942674e+4,
                                5.2264952788528545610e+3};
    static const double c[8] = {1.42343711074968357734e0,  4.63033784615654529590e0, 5.76949722146069140550e0,
                                3.64784832476320460504e0,  1.27045825245236838258e0, 2.41780725177450611770e-1,
                                2.27238449892691845833e-2, 7.74545014278341407640e-4};
    static const double d[7] = {2.05319162663775882187e0,  1.67638483018380384940e0,  6.89767334985100004550e-1,
                                1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4,
                                1.05075007164441684324e-9};
    static const double e[8] = {6.65790464350110377720e0,  5.46378491116411436990e0,  1.78482653991729133580e0,
                                2.96560571828504891230e-1, 2.65321895265761230930e-2, 1.24266094738807843860e-3,
                                2.71155556874348757815e-5, 2.01033439929228813265e-7};
    static const double f[7] = {5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2,
                                7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7,
                                2.04426310338993978564e-15};
    const double q = p - 0.5;
    if (fabs(q) <= 0.425) return q * poly_ratio(a, b, 0.180625 - q * q);
    const double r = sqrt(-det_log(q < 0.0 ? p : 1.0 - p));
    const double z = r <= 5.0 ? poly_ratio(c, d, r - 1.6) : poly_ratio(e, f, r - 5.0);
    return q < 0.0 ? -z : z;
}

double rng_gauss(struct rng *r)
{
    return rng_normal(rng_u64(r));
}

double rng_normal(uint64_t u)
{
    return inverse_normal(uniform_of(u));
}
