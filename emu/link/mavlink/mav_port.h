/* Where MAVLink peers are: UDP on 127.0.0.1, TCP on 127.0.0.1, or a pseudo-terminal; and the station that they talk to.
 *
 *   UDP out   datagrams go to one port; its answers come back to ours
 *   UDP in    we have the port; who sends to it gets everything from then on, up to MAV_PEERS_MAX
 *   TCP       a server for up to MAV_PEERS_MAX clients
 *   pty       one program after the other
 *
 * Every message goes to every peer. A peer that reads too slowly loses whole messages, counted; in step and free pace time
 * waits for TCP and pty instead. Owned by the application, never moved while open, one thread. */
#ifndef PSABENCH_LINK_MAVLINK_MAV_PORT_H
#define PSABENCH_LINK_MAVLINK_MAV_PORT_H

#include "link/listener.h"
#include "link/mavlink/mav_kind.h"
#include "link/mavlink/mav_station.h"
#include "link/pty.h"

#define MAV_PEERS_MAX 8u

struct mav_peer;

struct mav_port {
    struct listener listen; /* first: of TCP */
    struct link udp;
    struct pty pty;
    enum mav_port_kind kind;
    uint16_t port; /* as bound; of UDP out the peer's */
    bool lossless; /* time waits for a slow TCP or pty peer */
    struct links *links;
    struct mav_station station; /* open before the port, sdo.hub and node set; its send() is the port's */
    struct mav_peer *peer[MAV_PEERS_MAX];
    uint64_t heard; /* messages of all peers so far: their order */
    uint32_t lost, strangers;
};

/* kind, port (0: a free one), lossless and links are filled in by the caller, who opens the station with these. */
void mav_port_send(void *port, const uint8_t *frame, size_t n); /* mav_io.send */

/* name: symbolic link of a pty, may be NULL; kept by pointer. 0, or -errno: -EADDRINUSE, as pty_open(), -ENOMEM. */
int mav_port_open(struct mav_port *p, const char *name);

/* Peers are the loop's: marked as gone and released by links_reap(). The station is closed. */
void mav_port_close(struct mav_port *p);

#endif
