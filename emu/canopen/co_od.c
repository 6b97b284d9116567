#include "canopen/co_od.h"

#include "base/bits.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* First entry not before (index, sub). */
static unsigned lower_bound(const struct co_od *od, uint32_t key)
{
    unsigned low = 0;
    unsigned high = od->count;
    while (low < high) {
        const unsigned mid = (low + high) / 2;
        const uint32_t at = (uint32_t)od->entry[mid].index << 8 | od->entry[mid].sub;
        if (at < key) {
            low = mid + 1;
        } else {
            high = mid;
        }
    }
    return low;
}

const struct co_entry *co_find(const struct co_od *od, uint16_t index, uint8_t sub, uint32_t *abort)
{
    const unsigned i = lower_bound(od, (uint32_t)index << 8 | sub);
    if (i < od->count && od->entry[i].index == index && od->entry[i].sub == sub) return &od->entry[i];
    const unsigned first = lower_bound(od, (uint32_t)index << 8);
    const bool object = first < od->count && od->entry[first].index == index;
    *abort = object ? CO_AB_NO_SUB : CO_AB_NO_OBJECT;
    return NULL;
}

static const struct type {
    uint8_t bytes;
    bool is_signed;
} types[] = {
    [CO_BOOLEAN] = {1, false},   [CO_INTEGER8] = {1, true},    [CO_INTEGER16] = {2, true},   [CO_INTEGER32] = {4, true},
    [CO_UNSIGNED8] = {1, false}, [CO_UNSIGNED16] = {2, false}, [CO_UNSIGNED32] = {4, false}, [CO_REAL32] = {4, true},
    [CO_INTEGER24] = {3, true},  [CO_UNSIGNED24] = {3, false},
};

/* No bytes: not a number, or a type that this table does not know. */
static struct type type_of(uint8_t type)
{
    return type < sizeof types / sizeof types[0] ? types[type] : (struct type){0, false};
}

size_t co_type_size(uint8_t type)
{
    return type_of(type).bytes;
}

static void set_text(struct co_value *v, const char *text, size_t len)
{
    v->len = (uint16_t)(len > CO_TEXT_MAX ? CO_TEXT_MAX : len);
    memcpy(v->text, text, v->len);
    v->text[v->len] = '\0';
}

void co_default(const struct co_entry *e, uint8_t node_id, struct co_value *v)
{
    v->number = e->value + (e->flags & CO_PLUS_NODE ? node_id : 0);
    set_text(v, e->text ? e->text : "", e->text ? strlen(e->text) : 0);
}

double co_default_number(const struct co_od *od, uint16_t index, uint8_t sub, uint8_t node_id)
{
    uint32_t abort = CO_OK;
    struct co_value v = {.number = 0.0};
    const struct co_entry *e = co_find(od, index, sub, &abort);
    if (e) co_default(e, node_id, &v);
    return v.number;
}

static int64_t clip_number(const struct co_entry *e, double number)
{
    const unsigned bits = 8u * (unsigned)co_type_size(e->type);
    const bool is_signed = type_of(e->type).is_signed;
    const double low = is_signed ? -ldexp(1.0, (int)bits - 1) : 0.0;
    const double high = ldexp(1.0, (int)bits - (is_signed ? 1 : 0)) - 1.0;
    if (!(number > low)) return (int64_t)low;
    return (int64_t)(number < high ? nearbyint(number) : high);
}

size_t co_encode(const struct co_entry *e, const struct co_value *v, uint8_t *out, size_t cap)
{
    if (e->type == CO_VISIBLE_STRING) {
        const size_t n = v->len < cap ? v->len : cap;
        memcpy(out, v->text, n);
        return n;
    }
    const size_t n = co_type_size(e->type);
    if (n > cap) return 0;
    uint32_t raw = 0;
    if (e->type == CO_REAL32) {
        const float f = (float)v->number;
        memcpy(&raw, &f, sizeof raw);
    } else {
        raw = (uint32_t)clip_number(e, v->number);
    }
    bits_put_le(out, raw, n);
    return n;
}

static double number_of(const struct co_entry *e, uint32_t raw, size_t n)
{
    assert(n >= 1 && n <= sizeof raw);
    if (e->type == CO_REAL32) {
        float f = 0;
        memcpy(&f, &raw, sizeof f);
        return (double)f;
    }
    return type_of(e->type).is_signed ? bits_sign_extend(raw, 8u * (unsigned)n) : (double)raw;
}

uint32_t co_decode(const struct co_entry *e, const uint8_t *in, size_t n, struct co_value *v)
{
    if (e->type == CO_VISIBLE_STRING) {
        if ((double)n > e->high || n > CO_TEXT_MAX) return CO_AB_TOO_LONG;
        set_text(v, (const char *)in, n);
        return CO_OK;
    }
    const size_t want = co_type_size(e->type);
    if (want == 0) return CO_AB_GENERAL; /* a type this table does not know */
    if (n > want) return CO_AB_TOO_LONG;
    if (n < want) return CO_AB_TOO_SHORT;
    v->number = number_of(e, (uint32_t)bits_get_le(in, n), n);
    v->len = 0;
    /* Written so that a REAL32 that is no number fails too. */
    return v->number >= e->low && v->number <= e->high ? CO_OK : CO_AB_VALUE;
}
