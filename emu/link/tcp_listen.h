/* A TCP server's descriptor, on 127.0.0.1 and nowhere else. */
#ifndef PSABENCH_LINK_TCP_LISTEN_H
#define PSABENCH_LINK_TCP_LISTEN_H

#include <stdint.h>

/* Listens, non-blocking, at *port; 0: a free one, which is reported. The descriptor, or -errno. */
int tcp_listen(uint16_t *port);

#endif
