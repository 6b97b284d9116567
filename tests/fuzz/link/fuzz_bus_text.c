/* Lines of the bus port: any bytes are a request or are refused, and what is answered is one line. */
#include "fuzz.h"

#include "link/line/bus_text.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bus_request r;
    unsigned fields = 99;
    char out[BUS_TEXT_MAX];
    const enum bus_text_err err = bus_text_parse((const char *)data, size, &r, &fields);
    assert(fields <= 2 && r.op <= BUS_WHO && r.strobe_ns >= 0 && r.strobe_ns <= 999999999);
    assert(err != BUS_TEXT_OK || fields == (r.op == BUS_WHO ? 1 : 2));
    assert((size > BUS_TEXT_LINE_MAX) == (err == BUS_TEXT_OVERLONG));
    const size_t n = err == BUS_TEXT_OK ? bus_text_done(&r, r.data, INT64_MAX, out)
                                        : bus_text_refused(&r, fields, bus_text_code(err), INT64_MAX, out);
    assert(n < sizeof out && n == strlen(out) && strchr(out, '\n') == out + n - 1);
    return 0;
}
