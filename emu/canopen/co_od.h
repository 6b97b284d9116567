/* Object dictionary: a const table of entries, sorted by index and sub-index, and encoding of values.
 *
 * The table says what exists, of which type, with which rights, limits and default; where a value is stored is up to
 * the function that answers the access. Numbers are handled as double, which holds every type here exactly. Pure. Types and
 * abort codes: CiA 301, 7.4.7 and 7.2.4.3.17. */
#ifndef PSABENCH_CANOPEN_CO_OD_H
#define PSABENCH_CANOPEN_CO_OD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CO_TEXT_MAX 255u /* characters of a string value */

enum co_type {
    CO_BOOLEAN = 0x01,
    CO_INTEGER8 = 0x02,
    CO_INTEGER16 = 0x03,
    CO_INTEGER32 = 0x04,
    CO_UNSIGNED8 = 0x05,
    CO_UNSIGNED16 = 0x06,
    CO_UNSIGNED32 = 0x07,
    CO_REAL32 = 0x08,
    CO_VISIBLE_STRING = 0x09,
    CO_INTEGER24 = 0x10,
    CO_UNSIGNED24 = 0x16
};

enum co_access { CO_CONST, CO_RO, CO_WO, CO_RW };

enum { CO_PLUS_NODE = 1 }; /* flags: the node id is added to the value */

/* One entry; for strings high is the most characters and text the value. */
struct co_entry {
    uint16_t index;
    uint8_t sub;
    uint8_t type;   /* enum co_type */
    uint8_t access; /* enum co_access */
    uint8_t flags;
    double value, low, high;
    const char *text;
};

struct co_od {
    const struct co_entry *entry;
    unsigned count;
};

/* A value: number, or len characters of text. */
struct co_value {
    double number;
    uint16_t len;
    char text[CO_TEXT_MAX + 1];
};

/* SDO abort codes; CO_PENDING is no abort: the answer comes later (co_sdo.h). */
#define CO_OK            0x00000000u
#define CO_PENDING       0x00000001u
#define CO_AB_TOGGLE     0x05030000u
#define CO_AB_TIMEOUT    0x05040000u
#define CO_AB_COMMAND    0x05040001u
#define CO_AB_WRITE_ONLY 0x06010001u
#define CO_AB_READ_ONLY  0x06010002u
#define CO_AB_NO_OBJECT  0x06020000u
#define CO_AB_LENGTH     0x06070010u
#define CO_AB_TOO_LONG   0x06070012u
#define CO_AB_TOO_SHORT  0x06070013u
#define CO_AB_NO_SUB     0x06090011u
#define CO_AB_VALUE      0x06090030u
#define CO_AB_GENERAL    0x08000000u
#define CO_AB_TRANSFER   0x08000020u /* could not be transferred to the application */
#define CO_AB_STATE      0x08000022u /* not in the present device state */

/* Whether an access may be tried: CO_OK, CO_AB_WRITE_ONLY or CO_AB_READ_ONLY. */
static inline uint32_t co_may_read(const struct co_entry *e)
{
    return e->access == CO_WO ? CO_AB_WRITE_ONLY : CO_OK;
}

static inline uint32_t co_may_write(const struct co_entry *e)
{
    return e->access == CO_RO || e->access == CO_CONST ? CO_AB_READ_ONLY : CO_OK;
}

/* The entry, or NULL with *abort: no such object, or no such sub-index. */
const struct co_entry *co_find(const struct co_od *od, uint16_t index, uint8_t sub, uint32_t *abort);

/* Bytes of a value of the type; 0 for strings. */
size_t co_type_size(uint8_t type);

/* Value of a const entry, and the default of the others. */
void co_default(const struct co_entry *e, uint8_t node_id, struct co_value *v);
double co_default_number(const struct co_od *od, uint16_t index, uint8_t sub, uint8_t node_id); /* 0: no such entry */

/* To little-endian bytes, at most cap; returns their number. A number outside its type is clipped. */
size_t co_encode(const struct co_entry *e, const struct co_value *v, uint8_t *out, size_t cap);

/* From n bytes; CO_OK, or CO_AB_TOO_LONG, CO_AB_TOO_SHORT, CO_AB_VALUE (limits of the entry, not a number). */
uint32_t co_decode(const struct co_entry *e, const uint8_t *in, size_t n, struct co_value *v);

#endif
