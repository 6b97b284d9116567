/* TCP on 127.0.0.1 and nowhere else: servers, connections, and what a peer has not read yet. */
#ifndef PSABENCH_LINK_TCP_H
#define PSABENCH_LINK_TCP_H

#include <stdint.h>

/* Listens, non-blocking, at *port; 0: a free one, which is reported. The descriptor, or -errno. */
int tcp_listen(uint16_t *port);

/* A connection of a server, non-blocking, whose small segments go out at once; -1: none. */
int tcp_accept(int listener);

/* After a read: what is asked next need not wait for the acknowledgement of the packet before. */
void tcp_quick_ack(int fd);

/* Bytes in the receive queue of the other end of a connection: only the kernel of both ends knows. -1: not known. */
long tcp_peer_unread(int fd);

#endif
