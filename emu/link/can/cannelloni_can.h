/* Adapter: a tunnel of cannelloni over UDP on 127.0.0.1, whose other end is a cannelloni with an interface of the kernel,
 * or a program that speaks its format; classic, FD and remote frames.
 *
 * As cannelloni, it looks at the address that a datagram comes from, not at the port. Error frames of the bus are not sent:
 * the peer would put them on a real interface as frames. Losses show by seq_no and by the kernel's counter. */
#ifndef PSABENCH_LINK_CAN_CANNELLONI_CAN_H
#define PSABENCH_LINK_CAN_CANNELLONI_CAN_H

#include "link/can/dgram_can.h"

struct cannelloni_ports {
    uint16_t own, peer; /* own 0: a free one */
};

struct cannelloni_can {
    struct dgram_can io; /* first */
    struct cannelloni_ports ports;
    uint8_t next_seq; /* of the peer */
    bool heard;       /* next_seq is known */
    uint32_t counted; /* io.rxq_ovfl at the peer's latest datagram */
};

/* "", "PORT" or "PORT:PEER_PORT"; what is absent is 20000 and 20001. False: no such ports, or they are the same. */
bool cannelloni_can_ports(const char *text, struct cannelloni_ports *out);

/* 0, or -errno: -EADDRINUSE the port is taken. */
int cannelloni_can_open(struct cannelloni_can *c, struct can_hub *hub, struct cannelloni_ports ports);
void cannelloni_can_close(struct cannelloni_can *c);

#endif
