/* A frame as text, in the notation of can-utils: 123#1122, 12345678#R4, 123##1112233 (FD; the digit after ## is 1 with bit rate
 * switch). Capital digits; what candump(1) writes and cansend(1) takes. Pure. */
#ifndef PSABENCH_BASE_CAN_TEXT_H
#define PSABENCH_BASE_CAN_TEXT_H

#include "base/can/can.h"

#define CAN_TEXT_MAX 144u /* 8 + 3 + 128 digits, NUL and room */

/* Returns its length. Of an error frame: its identifier with the kernel's bit for one. */
size_t can_text_put(const struct can_msg *m, char out[CAN_TEXT_MAX]);

/* False for what is no such frame; m is undefined then. */
bool can_text_get(const char *text, struct can_msg *m);

#endif
