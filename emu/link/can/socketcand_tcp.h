/* Adapter: the socketcand protocol on 127.0.0.1, for any number of clients up to SOCKETCAND_CLIENTS_MAX.
 *
 * Workarounds for python-can's client: each answer of the handshake is a segment of its own; frames wait
 * until the client has read the < ok > to rawmode; only whole messages are queued; TCP_NODELAY, and TCP_QUICKACK after
 * each read, save it 40 ms a request. A client whose channel is closed stays on the bus until its frames have gone out. */
#ifndef PSABENCH_LINK_CAN_SOCKETCAND_TCP_H
#define PSABENCH_LINK_CAN_SOCKETCAND_TCP_H

#include "link/can/can_hub.h"
#include "link/listener.h"

#include <stdint.h>

#define SOCKETCAND_PORT        29536u
#define SOCKETCAND_CLIENTS_MAX 32u
#define SOCKETCAND_HOLD_MS     20u  /* the stream waits at least this long after < ok > to rawmode, */
#define SOCKETCAND_HOLD_MAX    100u /* and until the client has read it, at most this many times as long */
#define SOCKETCAND_PAD         64u  /* of messages after rawmode, so that python-can cuts none: see socketcand.h */

struct socketcand_server {
    struct listener listen;
    struct can_hub *hub; /* the buses, `hubs` in a row */
    unsigned hubs;       /* one: `open` takes any name; several: the name of a bus */
    uint16_t port;       /* bound */
    uint32_t clients;    /* connected */
};

/* Binds and listens; port 0 takes a free one. 0, or -errno. The server must not move afterwards. */
int socketcand_listen(struct socketcand_server *s, struct can_hub *hub, unsigned hubs, uint16_t port);

void socketcand_close(struct socketcand_server *s); /* no new clients; connected ones are closed with their links */

#endif
