/* How much of what a loopback peer was sent it has not read yet: only the kernel of both ends knows. */
#ifndef PSABENCH_LINK_TCP_PEER_H
#define PSABENCH_LINK_TCP_PEER_H

/* Bytes in the receive queue of the other end of a connection over 127.0.0.1; -1: not known. */
long tcp_peer_unread(int fd);

#endif
