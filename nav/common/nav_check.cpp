#include "nav/common/nav_check.hpp"

#include "nav/common/nav_math.hpp"

#include <cstring>

int check_refuse(struct nav_refusal *why, int status, const char *field, double value, const char *want)
{
    if (why) *why = {status, -1, value, field, want};
    return status;
}

static double value_of(const void *structure, const struct check_rule *rule)
{
    const char *at = (const char *)structure + rule->offset;
    double x;
    int n;
    if (!rule->is_int) return memcpy(&x, at, sizeof x), x;
    return memcpy(&n, at, sizeof n), n;
}

int check_rules(const void *structure, const struct check_rule *rules, size_t count, struct nav_refusal *why)
{
    for (size_t i = 0; i < count; i++) {
        const double x = value_of(structure, &rules[i]);
        if (!std::isfinite(x)) return check_refuse(why, NAV_NOT_FINITE, rules[i].field, x, rules[i].want);
        if (x < rules[i].low || x > rules[i].high)
            return check_refuse(why, NAV_RANGE, rules[i].field, x, rules[i].want);
    }
    return NAV_OK;
}
