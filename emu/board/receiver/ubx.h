/* UBX-NAV-PVT: position, velocity in three dimensions and time in one packet, as u-blox M8 receivers send it (protocol
 * specification UBX-13003221, UBX-NAV-PVT: 92 bytes of payload). Pure. */
#ifndef PSABENCH_BOARD_RECEIVER_UBX_H
#define PSABENCH_BOARD_RECEIVER_UBX_H

#include "board/receiver/report.h"

enum { UBX_PVT_PAYLOAD = 92, UBX_PVT_LEN = UBX_PVT_PAYLOAD + 8 };

void ubx_write_pvt(const struct report *r, uint8_t out[UBX_PVT_LEN]);

/* The two bytes CK_A, CK_B over class, identifier, length and payload: Fletcher's, modulo 256. */
void ubx_checksum(const uint8_t *bytes, size_t len, uint8_t ck[2]);

#endif
