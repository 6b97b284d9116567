/* Recognises HTTP and TLS on a text port. A web page can make a browser POST to any port of this machine; without this check
 * the port would execute the lines of the body. */
#ifndef PSABENCH_LINK_HTTP_H
#define PSABENCH_LINK_HTTP_H

#include <stdbool.h>
#include <stddef.h>

enum { HTTP_LOOK = 8 }; /* bytes that decide */

/* Whether these are the first bytes of an HTTP request (RFC 9110, 9.3), of its Host
 * header, or of a TLS handshake (RFC 8446). */
bool http_begins(const char *bytes, size_t n);

/* Whether a line is the first one of a request, whatever its method. */
bool http_line(const char *line, size_t n);

#endif
