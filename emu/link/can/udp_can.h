/* Adapter: CAN frames in UDP multicast datagrams, as python-can's udp_multicast interface has them; classic, FD, remote and
 * error frames.
 *
 * The hop limit is 0: no datagram leaves this machine, and those of other machines are refused. A datagram comes back to
 * each member of its group, the sender included: the adapter sends from a port of its own and passes over what comes from
 * there. Between programs that send to each other directly there is no bit rate and no arbitration. */
#ifndef PSABENCH_LINK_CAN_UDP_CAN_H
#define PSABENCH_LINK_CAN_UDP_CAN_H

#include "link/can/dgram_can.h"

#include <netinet/in.h>

#define UDP_CAN_GROUP "239.74.163.2:43113" /* python-can's own IPv4 group */

struct udp_can {
    struct dgram_can io; /* first */
    char group[INET6_ADDRSTRLEN];
    uint16_t port;
    struct sockaddr_storage self, asked; /* where we send from; the last other address that was looked up */
    bool asked_local;                    /* it is one of this machine */
};

/* The address of "GROUP", "GROUP:PORT" or "[GROUP]:PORT"; without PORT it is 43113. False: not a group in 239.0.0.0/8 or
 * ff00::/8, or no such port; *out is untouched. */
bool udp_can_group(const char *text, struct sockaddr_storage *out);

/* 0, or -errno: -EINVAL no such group; -ENODEV, -ENETUNREACH, -EADDRNOTAVAIL no route to it. */
int udp_can_open(struct udp_can *u, struct can_hub *hub, const char *group);
void udp_can_close(struct udp_can *u);

#endif
