#define _POSIX_C_SOURCE 200809L /* strnlen */
#include "link/can/udp_frame.h"

#include "base/bits.h"

#include <string.h>

/* First bytes of msgpack values. */
enum {
    MAP_4 = 0x80,
    STR_5 = 0xa0,
    NIL = 0xc0,
    FALSE = 0xc2,
    TRUE = 0xc3,
    BIN_8 = 0xc4,
    FLOAT_32 = 0xca,
    FLOAT_64 = 0xcb,
    UINT_8 = 0xcc,
    UINT_64 = 0xcf,
    INT_8 = 0xd0,
    INT_64 = 0xd3,
    STR_8 = 0xd9
};

enum key { TIMESTAMP, ID, EXTENDED, REMOTE, ERROR, CHANNEL, DLC, DATA, FD, SWITCH, INDICATOR, KEYS };
static const char *const names[KEYS] = {
    "timestamp", "arbitration_id", "is_extended_id", "is_remote_frame", "is_error_frame",       "channel",
    "dlc",       "data",           "is_fd",          "bitrate_switch",  "error_state_indicator"};

/* ---- encoder */

static uint8_t *put_be(uint8_t *p, uint64_t v, unsigned n)
{
    bits_put_be(p, v, n);
    return p + n;
}

static uint8_t *put_uint(uint8_t *p, uint32_t v)
{
    if (v < 0x80) return put_be(p, v, 1);
    const unsigned log2n = v > 0xFFFF ? 2 : v > 0xFF ? 1 : 0;
    *p++ = (uint8_t)(UINT_8 + log2n);
    return put_be(p, v, 1u << log2n);
}

static uint8_t *put_text(uint8_t *p, const char *text)
{
    const size_t n = strnlen(text, 31);
    *p++ = (uint8_t)(STR_5 | n);
    memcpy(p, text, n);
    return p + n;
}

static uint8_t *put_flag(uint8_t *p, enum key key, bool on)
{
    p = put_text(p, names[key]);
    *p++ = on ? TRUE : FALSE;
    return p;
}

static uint8_t *put_double(uint8_t *p, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    *p++ = FLOAT_64;
    return put_be(p, bits, 8);
}

static uint8_t *put_data(uint8_t *p, const struct can_msg *m)
{
    const uint8_t n = m->flags & CAN_RTR ? 0 : m->len;
    *p++ = BIN_8;
    *p++ = n;
    memcpy(p, m->data, n);
    return p + n;
}

size_t udp_frame_encode(const struct can_msg *m, double timestamp_s, const char *channel, uint8_t out[UDP_FRAME_MAX])
{
    uint8_t *p = out;
    *p++ = MAP_4 | KEYS;
    p = put_double(put_text(p, names[TIMESTAMP]), timestamp_s);
    p = put_uint(put_text(p, names[ID]), m->id);
    p = put_flag(p, EXTENDED, m->flags & CAN_EXT);
    p = put_flag(p, REMOTE, m->flags & CAN_RTR);
    p = put_flag(p, ERROR, m->flags & CAN_ERROR);
    p = put_text(p, names[CHANNEL]);
    if (channel) p = put_text(p, channel);
    else *p++ = NIL;
    p = put_uint(put_text(p, names[DLC]), m->len);
    p = put_data(put_text(p, names[DATA]), m);
    p = put_flag(p, FD, m->flags & CAN_FD);
    p = put_flag(p, SWITCH, m->flags & CAN_BRS);
    p = put_flag(p, INDICATOR, false);
    return (size_t)(p - out);
}

/* ---- decoder */

struct value {
    enum { OTHER, BOOL, UINT, TEXT, BYTES } type;
    uint64_t number; /* of BOOL and UINT; length of TEXT and BYTES */
    const uint8_t *at;
};

struct in {
    const uint8_t *p, *end;
};

/* n bytes as a number, n up to 8; false: there are fewer. */
static bool take_be(struct in *in, unsigned n, uint64_t *v)
{
    if ((size_t)(in->end - in->p) < n) return false;
    *v = 0;
    while (n--) *v = *v << 8 | *in->p++;
    return true;
}

/* The n bytes of a text or of data. */
static bool take_span(struct in *in, int type, uint64_t n, struct value *v)
{
    if ((uint64_t)(in->end - in->p) < n) return false;
    *v = (struct value){.type = type ? BYTES : TEXT, .number = n, .at = in->p};
    in->p += n;
    return true;
}

/* A length of 1, 2 or 4 bytes, and as many bytes. */
static bool take_long(struct in *in, bool bytes, unsigned log2n, struct value *v)
{
    uint64_t n;
    return take_be(in, 1u << log2n, &n) && take_span(in, bytes, n, v);
}

static bool take_number(struct in *in, uint8_t first, struct value *v)
{
    if (first == FLOAT_32 || first == FLOAT_64) return take_be(in, first == FLOAT_32 ? 4 : 8, &v->number);
    const bool sign = first >= INT_8;
    const bool negative = sign && in->p < in->end && *in->p & 0x80; /* the first byte has the sign */
    v->type = negative ? OTHER : UINT;
    return take_be(in, 1u << (first - (sign ? INT_8 : UINT_8)), &v->number);
}

/* A scalar, a text or data; false: cut short, or an array, a map or an extension. */
static bool take_value(struct in *in, struct value *v)
{
    *v = (struct value){.type = OTHER};
    if (in->p == in->end) return false;
    const uint8_t first = *in->p++;
    if (first < 0x80) *v = (struct value){.type = UINT, .number = first};
    else if (first >= 0xe0 || first == NIL) return true;
    else if (first == FALSE || first == TRUE) *v = (struct value){.type = BOOL, .number = first == TRUE};
    else if (first >> 5 == STR_5 >> 5) return take_span(in, false, first & 31u, v);
    else if (first >= BIN_8 && first < BIN_8 + 3) return take_long(in, true, first - BIN_8, v);
    else if (first >= STR_8 && first < STR_8 + 3) return take_long(in, false, first - STR_8, v);
    else if (first >= FLOAT_32 && first <= INT_64) return take_number(in, first, v);
    else return false;
    return true;
}

static bool take_key(struct in *in, unsigned *key)
{
    struct value v;
    if (!take_value(in, &v) || v.type != TEXT) return false;
    for (*key = 0; *key < KEYS; ++*key) {
        if (strlen(names[*key]) == v.number && memcmp(names[*key], v.at, v.number) == 0) return true;
    }
    return false;
}

static bool take_size(struct in *in, uint64_t *n)
{
    uint64_t first;
    if (!take_be(in, 1, &first)) return false;
    if (first == 0xde) return take_be(in, 2, n);
    *n = first & 15;
    return first >> 4 == MAP_4 >> 4;
}

static bool take_map(struct in *in, struct value values[KEYS])
{
    uint64_t n;
    if (!take_size(in, &n) || n > KEYS) return false;
    while (n--) {
        unsigned key;
        if (!take_key(in, &key) || !take_value(in, &values[key])) return false;
    }
    return in->p == in->end;
}

/* The value of a flag, which may be absent. */
static bool is_on(const struct value *v)
{
    return v->type == BOOL && v->number;
}

static bool types_fit(const struct value v[KEYS])
{
    static const enum key flags[] = {EXTENDED, REMOTE, ERROR, FD, SWITCH, INDICATOR};
    for (unsigned i = 0; i < sizeof flags / sizeof *flags; i++)
        if (v[flags[i]].type != BOOL) return false;
    const bool no_data = v[DATA].type == OTHER;
    return v[ID].type == UINT && v[ID].number <= 0x1FFFFFFF && v[DLC].type == UINT && v[DLC].number <= 64 &&
           (no_data || v[DATA].type == BYTES);
}

bool udp_frame_decode(const uint8_t *bytes, size_t size, struct can_msg *out)
{
    static const struct value no = {.type = BOOL};
    struct value v[KEYS] = {[ID] = {.type = UINT},
                            [EXTENDED] = {.type = BOOL, .number = 1},
                            [REMOTE] = no,
                            [ERROR] = no,
                            [FD] = no,
                            [SWITCH] = no,
                            [INDICATOR] = no,
                            [DLC] = {.type = UINT, .number = 65}};
    struct in in = {bytes, bytes + size};
    if (size > UDP_FRAME_MAX || !take_map(&in, v)) return false;
    const uint64_t length = v[DATA].type == BYTES ? v[DATA].number : 0;
    if (v[DLC].number == 65) v[DLC].number = length; /* absent */
    if (!types_fit(v) || length != (is_on(&v[REMOTE]) ? 0 : v[DLC].number)) return false;
    struct can_msg m = {.id = (uint32_t)v[ID].number, .len = (uint8_t)v[DLC].number};
    m.flags = (uint8_t)((is_on(&v[EXTENDED]) ? CAN_EXT : 0) | (is_on(&v[REMOTE]) ? CAN_RTR : 0) |
                        (is_on(&v[ERROR]) ? CAN_ERROR : 0) | (is_on(&v[FD]) ? CAN_FD : 0) |
                        (is_on(&v[SWITCH]) ? CAN_BRS : 0));
    if (!can_valid(&m)) return false;
    if (length) memcpy(m.data, v[DATA].at, length);
    *out = m;
    return true;
}
