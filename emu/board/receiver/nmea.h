/* Sentences of NMEA 0183 version 2.3 and later (mode indicator in RMC and VTG), talker GP. Pure; no allocation.
 *
 * A sentence has at most 82 characters, "$" and CR LF included. Latitude and longitude have five digits of a
 * minute, 2 cm. What a receiver without a fix does not know stays empty. */
#ifndef PSABENCH_BOARD_RECEIVER_NMEA_H
#define PSABENCH_BOARD_RECEIVER_NMEA_H

#include "board/receiver/report.h"

#define NMEA_MAX 82u

enum nmea_kind { NMEA_GGA, NMEA_GSA, NMEA_RMC, NMEA_VTG, NMEA_ZDA, NMEA_KINDS };

struct nmea {
    char text[NMEA_MAX + 1]; /* with its checksum, CR LF and a terminating 0 */
    unsigned len;
};

void nmea_write(const struct report *r, enum nmea_kind kind, struct nmea *out);

/* The exclusive or of what is between $ and *. */
uint8_t nmea_checksum(const char *text, size_t len);

#endif
