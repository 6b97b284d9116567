#include "link/mavlink/mav_param.h"

#include <math.h>
#include <string.h>

enum mav_param_type mav_param_type(const struct mav_param *p)
{
    if (p->code == MAV_CODE_REAL || p->bytes < 4) return MAV_PARAM_R32;
    return p->code == MAV_CODE_SIGNED ? MAV_PARAM_I32 : MAV_PARAM_U32;
}

static float float_of_bits(uint32_t bits)
{
    float f;
    memcpy(&f, &bits, sizeof f);
    return f;
}

static uint32_t bits_of_float(float f)
{
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

/* Of an integer within its range. */
static uint32_t integer_bits(double value)
{
    return value < 0 ? (uint32_t)(int32_t)value : (uint32_t)value;
}

float mav_param_wire(const struct mav_param *p, double value)
{
    return mav_param_type(p) == MAV_PARAM_R32 ? (float)value : float_of_bits(integer_bits(value));
}

bool mav_param_value(const struct mav_param *p, uint8_t type, float wire, double *value)
{
    const uint32_t bits = bits_of_float(wire);
    if (type == MAV_PARAM_R32) *value = (double)wire;
    else if (type == MAV_PARAM_I32) *value = (double)(int32_t)bits;
    else if (type == MAV_PARAM_U32) *value = (double)bits;
    else return false;
    if (!isfinite(*value)) return false;
    return p->code == MAV_CODE_REAL || *value == nearbyint(*value);
}

uint32_t mav_param_raw(const struct mav_param *p, double value)
{
    return p->code == MAV_CODE_REAL ? bits_of_float((float)value) : integer_bits(value);
}

double mav_param_number(const struct mav_param *p, uint32_t raw)
{
    const unsigned bits = 8u * p->bytes;
    if (p->code == MAV_CODE_REAL) return (double)float_of_bits(raw);
    const uint32_t used = bits < 32 ? raw & ((UINT32_C(1) << bits) - 1) : raw;
    const bool negative = p->code == MAV_CODE_SIGNED && used >> (bits - 1);
    return (double)used - (negative ? ldexp(1.0, (int)bits) : 0.0);
}

unsigned mav_param_find(const struct mav_param *rows, unsigned count, const char *name)
{
    unsigned i = 0;
    while (i < count && strncmp(rows[i].name, name, MAV_PARAM_NAME) != 0) i++;
    return i;
}
