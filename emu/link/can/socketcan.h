/* Adapter: a CAN interface of the kernel (vcan0, can0), raw socket, classic and FD.
 *
 * The only file that includes linux/can.h is socketcan.c. The kernel's vcan has no bit rate, no arbitration and no
 * back-pressure: the simulated bus paces the frames, but a receiver on the same machine that reads too slowly loses them
 * in its own socket, at every pace. */
#ifndef PSABENCH_LINK_CAN_SOCKETCAN_H
#define PSABENCH_LINK_CAN_SOCKETCAN_H

#include "link/can/can_hub.h"

#define SOCKETCAN_QUEUE 4096u

struct socketcan {
    struct link link; /* first */
    struct can_client can;
    struct can_hub *hub;
    struct can_msg queue[SOCKETCAN_QUEUE]; /* waits for the kernel */
    unsigned head, len;
    uint32_t rxq_ovfl; /* the kernel's counter of frames it lost before we read them */
    bool lost_reported, down_reported;
    bool virtual; /* by its name, vcan or vxcan: error frames are shown there; a real one would send them */
};

/* 0, or -errno: -EAFNOSUPPORT the kernel has no CAN, -ENODEV no such interface, -ENETDOWN it is down. */
int socketcan_open(struct socketcan *s, struct can_hub *hub, const char *interface);
void socketcan_close(struct socketcan *s);

#endif
