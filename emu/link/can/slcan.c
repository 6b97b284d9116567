#include "link/can/slcan.h"

#include "base/can/bits.h"
#include "base/hex.h"

#include <string.h>

static const uint8_t dlc_len[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

/* Letter by flags: every letter of the protocol once. */
static const struct {
    char letter;
    uint8_t flags;
} kinds[] = {
    {'t', 0},      {'T', CAN_EXT},          {'r', CAN_RTR},          {'R', CAN_RTR | CAN_EXT},
    {'d', CAN_FD}, {'D', CAN_FD | CAN_EXT}, {'b', CAN_FD | CAN_BRS}, {'B', CAN_FD | CAN_BRS | CAN_EXT},
};

static int kind_of(char letter)
{
    for (unsigned i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        if (kinds[i].letter == letter) return (int)i;
    }
    return -1;
}

static enum slcan_err decode_data(const char *p, size_t digits, struct can_msg *m)
{
    const size_t want = m->flags & CAN_RTR ? 0 : 2u * m->len;
    if (digits != want) return digits < want ? SLCAN_SHORT : SLCAN_LONG;
    for (size_t i = 0; i < want / 2; i++) {
        const int64_t byte = hex_get(p + 2 * i, 2);
        if (byte < 0) return SLCAN_DIGIT;
        m->data[i] = (uint8_t)byte;
    }
    return SLCAN_OK;
}

enum slcan_err slcan_decode(const char *line, size_t len, struct can_msg *out)
{
    const int kind = len ? kind_of(line[0]) : -1;
    if (kind < 0) return SLCAN_NO_FRAME;
    struct can_msg m = {.flags = kinds[kind].flags};
    const size_t id_digits = m.flags & CAN_EXT ? 8 : 3;
    if (len < 1 + id_digits + 1) return SLCAN_SHORT;
    const int64_t id = hex_get(line + 1, id_digits);
    const int dlc = hex_digit(line[1 + id_digits]);
    if (id < 0 || dlc < 0) return SLCAN_DIGIT;
    if (id > (m.flags & CAN_EXT ? 0x1FFFFFFF : 0x7FF)) return SLCAN_ID;
    if (dlc > 8 && !(m.flags & CAN_FD)) return SLCAN_DLC;
    m.id = (uint32_t)id;
    m.len = dlc_len[dlc];
    const size_t head = 1 + id_digits + 1;
    const enum slcan_err err = decode_data(line + head, len - head, &m);
    if (err == SLCAN_OK) *out = m;
    return err;
}

size_t slcan_encode(const struct can_msg *m, char *out, size_t cap)
{
    const uint8_t flags = m->flags & (CAN_EXT | CAN_RTR | CAN_FD | CAN_BRS);
    const size_t id_digits = flags & CAN_EXT ? 8 : 3;
    const size_t bytes = flags & CAN_RTR ? 0 : m->len;
    const size_t len = 1 + id_digits + 1 + 2 * bytes;
    if (cap < len || m->flags & CAN_ERROR || !can_valid(m)) return 0;
    for (unsigned i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        if (kinds[i].flags == flags) out[0] = kinds[i].letter;
    }
    hex_put(out + 1, m->id, id_digits);
    hex_put(out + 1 + id_digits, can_dlc(m->len), 1);
    for (size_t i = 0; i < bytes; i++) hex_put(out + 2 + id_digits + 2 * i, m->data[i], 2);
    return len;
}

uint8_t slcan_error_status(const struct can_msg *m)
{
    if (m->id & CAN_CLASS_PROTOCOL) return SLCAN_STATUS_BUS_ERROR;
    if (!(m->id & CAN_CLASS_CONTROLLER)) return SLCAN_STATUS_PASSIVE; /* bus-off, or back from it */
    if (m->data[1] & (CAN_CONTROLLER_RX_WARNING | CAN_CONTROLLER_TX_WARNING)) return SLCAN_STATUS_WARNING;
    return m->data[1] & (CAN_CONTROLLER_RX_PASSIVE | CAN_CONTROLLER_TX_PASSIVE) ? SLCAN_STATUS_PASSIVE : 0;
}
