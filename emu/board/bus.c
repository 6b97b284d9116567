#include "board/bus.h"

#include <assert.h>
#include <inttypes.h>
#include <stdio.h>

enum { DETAIL = 96 };

static const struct {
    const char *word, *why;
} results[] = {
    [BOARD_CYCLE_OK] = {"ok", ""},
    [BOARD_CYCLE_NO_ADDRESS] = {"no-address", "nothing answers at this address"},
    [BOARD_CYCLE_READ_ONLY] = {"read-only", "this register is read-only"},
    [BOARD_CYCLE_WRITE_ONLY] = {"write-only", "this register is write-only"},
    [BOARD_CYCLE_NOT_READY] = {"not-ready", "too early: no word waits there"},
    [BOARD_CYCLE_TOO_SHORT] = {"too-short", "the strobe is shorter than the board needs"},
    [BOARD_CYCLE_BUSY] = {"busy", "another cycle is under way, or a command; ask again when it is over"},
    [BOARD_CYCLE_BAD_VALUE] = {"bad-value", "the register does not take this value"},
    [BOARD_CYCLE_TAKEN] = {"taken", "too early: no word waits there; the board's built-in host takes each that comes, "
                                    "profile psd1_host has none"},
    [BOARD_CYCLE_OFF] = {"off", "the board has no power or is in reset"},
};

const char *board_cycle_word(enum board_cycle_result r)
{
    assert((size_t)r < sizeof results / sizeof *results);
    return results[r].word;
}

const char *board_bus_name(const struct board_bus *bus, unsigned address)
{
    return address < bus->addresses ? bus->registers[address].name : NULL;
}

/* "; 00h to 0Dh do": each board's are in a row. */
static void describe_addresses(const struct board_bus *bus, char *out, size_t cap)
{
    unsigned last = bus->addresses;
    while (last > 0 && !bus->registers[last - 1].name) last--;
    if (last > 0) (void)snprintf(out, cap, "; 00h to %02Xh do", last - 1);
}

static void describe_expected(const struct board_bus *bus, const struct board *board, const struct board_cycle *c,
                              enum board_cycle_result r, char *out, size_t cap)
{
    char expected[DETAIL] = "";
    out[0] = '\0';
    if (r == BOARD_CYCLE_NO_ADDRESS) describe_addresses(bus, out, cap);
    if (r == BOARD_CYCLE_TOO_SHORT) (void)snprintf(out, cap, ", at least %" PRId64 " ns", bus->strobe(board).least_ns);
    if ((r == BOARD_CYCLE_BAD_VALUE || r == BOARD_CYCLE_NOT_READY) && bus->expected)
        bus->expected(board, c, r, expected, sizeof expected);
    if (expected[0]) (void)snprintf(out, cap, r == BOARD_CYCLE_BAD_VALUE ? ": %s" : "; %s", expected);
}

void board_cycle_why(const struct board_bus *bus, const struct board *board, const struct board_cycle *c,
                     enum board_cycle_result r, char out[BOARD_CYCLE_WHY_MAX])
{
    char what[24] = "read of", detail[DETAIL];
    const char *const name = board_bus_name(bus, c->address);
    const int64_t strobe_ns = c->strobe_ns > 0 ? c->strobe_ns : bus->strobe(board).own_ns;
    assert((size_t)r < sizeof results / sizeof *results);
    if (c->write) (void)snprintf(what, sizeof what, "write of %u to", c->data);
    describe_expected(bus, board, c, r, detail, sizeof detail);
    (void)snprintf(out, BOARD_CYCLE_WHY_MAX, "%s address %02Xh (%s), strobe %" PRId64 " ns: %s%s", what, c->address,
                   name ? name : "nothing", strobe_ns, results[r].why, detail);
}
