/* What structures may hold, as tables: one row a field, in the order of the header. */
#ifndef PSABENCH_NAV_CHECK_HPP
#define PSABENCH_NAV_CHECK_HPP

#include "nav/nav.h"

#include <cstddef>

constexpr double CHECK_ANY = __DBL_MAX__;   /* as a limit: whatever is finite */
constexpr double CHECK_ABOVE = __DBL_MIN__; /* as the lower limit: above zero */

struct check_rule {
    const char *field;
    size_t offset;
    bool is_int;
    double low, high; /* inclusive */
    const char *want;
};
#define CHECK_DOUBLE(type, field, low, high, want)                                                                     \
    {                                                                                                                  \
#field, offsetof(type, field), false, low, high, want                                                          \
    }
#define CHECK_INT(type, field, low, high, want)                                                                        \
    {                                                                                                                  \
#field, offsetof(type, field), true, low, high, want                                                           \
    }

/* NAV_OK and nothing written, or the first rule that does not hold, in *why, which may be NULL. */
int check_rules(const void *structure, const struct check_rule *rules, size_t count, struct nav_refusal *why);

template <size_t COUNT>
int check_all(const void *structure, const struct check_rule (&rules)[COUNT], struct nav_refusal *why)
{
    return check_rules(structure, rules, COUNT, why);
}

/* status, with its cause in *why if that is not NULL. */
int check_refuse(struct nav_refusal *why, int status, const char *field, double value, const char *want);

#endif
