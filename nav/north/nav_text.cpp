#include "nav/nav.h"

#include <Eigen/Core>

#define TEXT_(x) #x
#define TEXT(x)  TEXT_(x)

int nav_abi(void)
{
    return NAV_ABI;
}

const char *nav_version(void)
{
    return TEXT(PSABENCH_VERSION) " eigen-" TEXT(EIGEN_WORLD_VERSION) "." TEXT(EIGEN_MAJOR_VERSION) "." TEXT(
        EIGEN_MINOR_VERSION); /* whose order of sums is in the last digits */
}

const char *nav_status_text(int status)
{
    static const char *const text[] = {
        "done",
        "too few positions, or too many: three directions determine the heading (exactly three for the closed form, "
        "four with a ramp, 64 at most)",
        "positions coincide: fewer than three directions that differ by half a degree leave sine, cosine and drift "
        "undetermined",
        "latitude beyond 85 degrees: the horizontal part of the Earth's rate is too small to find north by",
        "a number is not finite",
        "out of range",
        "windows must follow one another in time and have a length: correlated drift, white noise or a ramp was asked "
        "for",
        "the equations do not determine the unknowns",
    };
    const int count = (int)(sizeof text / sizeof *text);
    return status > 0 || -status >= count ? "unknown status" : text[-status];
}

const char *nav_flag_text(uint32_t flags)
{
    static const char *const text[] = {
        "poor geometry: the steps between positions are below 40 or above 175 degrees, errors grow",
        "sine and cosine do not lie on the circle: a wrong latitude, or rates that do not belong together",
        "simplified coefficients (14) were used for (13)",
        "no noise was given: standard deviations are 0 and say nothing",
        "the constrained fit did not settle",
    };
    for (unsigned bit = 0; bit < sizeof text / sizeof *text; bit++)
        if (flags >> bit & 1) return text[bit];
    return "";
}
