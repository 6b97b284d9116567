/* Adapter: slcan (Lawicel, with the FD letters of CANable 2.0) on a pseudo-terminal. One client.
 *
 * Commands: S0..S8 bit rate and Y0..Y8 data bit rate in Mbit/s (accepted when the bus has that rate or none), O open, L
 * open to listen only, C close, V v version, N serial number, F status, Z0 Z1 time stamps (ms of the simulated minute),
 * and frames. Answers: CR done, z CR and Z CR frame queued, BEL rejected. Rejected: s (bit timing registers), M m
 * (acceptance filters), X, U. The protocol has no error frames: F shows them,
 * bits 2 (error warning), 5 (error-passive or bus-off) and 7. The channel closes when the last program closes the
 * port. */
#ifndef PSABENCH_LINK_CAN_SLCAN_PTY_H
#define PSABENCH_LINK_CAN_SLCAN_PTY_H

#include "link/can/can_hub.h"
#include "link/pty.h"
#include "link/text_link.h"

struct slcan_pty {
    struct text_link io; /* first: the master */
    struct pty pty;
    struct can_client can;
    struct can_hub *hub;
    bool open, listen_only, stamps, closing;
    bool lost_reported;
    uint8_t status; /* F: bits of slcan.h */
};

/* 0, or -errno. The struct must not move afterwards. name: symbolic link, may be NULL; kept by pointer. */
int slcan_pty_open(struct slcan_pty *s, struct can_hub *hub, const char *name);
void slcan_pty_close(struct slcan_pty *s);

#endif
