/* slcan (Lawicel) text form of a frame, with the FD letters of the CANable 2.0 dialect.
 *
 *   tiiildd..  11-bit data   Tiiiiiiiildd..  29-bit data   r, R  the same, remote, no data
 *   diiildd..  11-bit FD     Diiiiiiiildd..  29-bit FD     b, B  the same with bit rate switch
 *
 * i: identifier, l: DLC, one hexadecimal digit (9..F only FD), d: data, two digits a byte; a line ends with CR, which
 * is not part of the text here. Example: t4563112233 is 456h with the bytes 11 22 33. Pure. */
#ifndef PSABENCH_LINK_CAN_SLCAN_H
#define PSABENCH_LINK_CAN_SLCAN_H

#include "base/can/can.h"

#include <stddef.h>

#define SLCAN_LINE_MAX 160u /* B + 8 + 1 + 128 digits, time stamp, CR and room */

enum slcan_err {
    SLCAN_OK,
    SLCAN_NO_FRAME, /* the letter does not begin a frame */
    SLCAN_SHORT,    /* fewer digits than the letter and the DLC ask for */
    SLCAN_LONG,     /* more digits */
    SLCAN_DIGIT,    /* not hexadecimal */
    SLCAN_ID,       /* identifier above 7FFh or 1FFFFFFFh */
    SLCAN_DLC       /* DLC above 8 in a classic frame */
};

/* No state between calls; out is untouched on error. */
enum slcan_err slcan_decode(const char *line, size_t len, struct can_msg *out);

/* Text without CR; 0 when cap is too small, the frame is not valid, or it is an error frame. */
size_t slcan_encode(const struct can_msg *m, char *out, size_t cap);

/* Bits of the answer to F. */
enum {
    SLCAN_STATUS_RX_FULL = 0x01,
    SLCAN_STATUS_WARNING = 0x04,
    SLCAN_STATUS_OVERRUN = 0x08,
    SLCAN_STATUS_PASSIVE = 0x20, /* error-passive or bus-off */
    SLCAN_STATUS_BUS_ERROR = 0x80
};

/* Status bits that an error message (can_error.h) sets. */
uint8_t slcan_error_status(const struct can_msg *m);

#endif
