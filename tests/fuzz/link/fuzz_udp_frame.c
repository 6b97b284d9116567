/* CAN frames in datagrams: what is accepted is a valid frame, and is the same frame after another round. */
#include "fuzz.h"

#include "link/can/udp_frame.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t bytes[UDP_FRAME_MAX];
    struct can_msg m, again;
    if (!udp_frame_decode(data, size, &m)) return 0;
    assert(can_valid(&m));
    const size_t n = udp_frame_encode(&m, 0.0, NULL, bytes);
    assert(n <= sizeof bytes && udp_frame_decode(bytes, n, &again));
    assert(again.id == m.id && again.flags == m.flags && again.len == m.len);
    assert(m.flags & CAN_RTR || memcmp(again.data, m.data, m.len) == 0);
    return 0;
}
