#include "base/can/text.h"

#include "base/hex.h"

#include <string.h>

#define ERROR_ID 0x20000000u /* CAN_ERR_FLAG of linux/can.h */

/* ---- writing ---- */

size_t can_text_put(const struct can_msg *m, char out[CAN_TEXT_MAX])
{
    const bool error = (m->flags & CAN_ERROR) != 0;
    const size_t id_digits = error || m->flags & CAN_EXT ? 8 : 3;
    char *at = out + id_digits;
    hex_put(out, error ? m->id | ERROR_ID : m->id, id_digits);
    *at++ = '#';
    if (m->flags & CAN_FD) {
        *at++ = '#';
        *at++ = m->flags & CAN_BRS ? '1' : '0';
    }
    if (m->flags & CAN_RTR) {
        *at++ = 'R';
        *at++ = (char)('0' + m->len);
    } else {
        for (unsigned i = 0; i < m->len; i++, at += 2) hex_put(at, m->data[i], 2);
    }
    *at = '\0';
    return (size_t)(at - out);
}

/* ---- reading ---- */

static int digit_value(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

static bool get_data(const char *text, struct can_msg *m)
{
    for (; text[0]; text += 2) {
        if (m->len == sizeof m->data || digit_value(text[0]) < 0 || digit_value(text[1]) < 0) return false;
        m->data[m->len++] = (uint8_t)(digit_value(text[0]) << 4 | digit_value(text[1]));
    }
    return true;
}

bool can_text_get(const char *text, struct can_msg *m)
{
    const size_t digits = strcspn(text, "#");
    *m = (struct can_msg){.flags = digits == 8 ? CAN_EXT : 0};
    if ((digits != 3 && digits != 8) || text[digits] != '#') return false;
    for (size_t i = 0; i < digits; i++) {
        if (digit_value(text[i]) < 0) return false;
        m->id = m->id << 4 | (uint32_t)digit_value(text[i]);
    }
    text += digits + 1;
    if (*text == '#') {
        if (text[1] != '0' && text[1] != '1') return false;
        m->flags |= text[1] == '1' ? CAN_FD | CAN_BRS : CAN_FD;
        text += 2;
    } else if (*text == 'R') {
        m->flags |= CAN_RTR;
        m->len = (uint8_t)digit_value(text[1]);
        return text[1] >= '0' && text[1] <= '8' && !text[2] && can_valid(m);
    }
    return get_data(text, m) && can_valid(m);
}
