/* TCP on 127.0.0.1 and nowhere else: servers, connections, and what a peer has not read yet. */
#ifndef PSABENCH_LINK_TCP_H
#define PSABENCH_LINK_TCP_H

#include <stdint.h>

/* Listens, non-blocking, at *port; 0: a free one, which is reported. The descriptor, or -errno. */
int tcp_listen(uint16_t *port);

/* Of a listening socket, before the first connection: segments to the peer have an even number of bytes, so that a peer that
 * takes each read as whole 16-bit words, as libsigrok does, is not cut off inside one. */
void tcp_even_segments(int fd);

/* Small segments of a connection go out at once. */
void tcp_no_delay(int fd);

/* Port of the other end of a connection; 0: not known. */
uint16_t tcp_peer_port(int fd);

/* After a read: what is asked next need not wait for the acknowledgement of the packet before. */
void tcp_quick_ack(int fd);

/* Bytes in the receive queue of the other end of a connection: only the kernel of both ends knows. -1: not known. */
long tcp_peer_unread(int fd);

#endif
