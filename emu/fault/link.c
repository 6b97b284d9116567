/* Faults of the links: what happens to frames on a bus, from a board, and on their way to a program (base/can/fault.h). */
#include "fault/internal.h"

#include <math.h>
#include <stdio.h>

enum { BUS_OFF, STALL };

static struct can_bus *bus_of(const struct control_bench *b, const struct can_node *node)
{
    for (unsigned i = 0; i < b->buses; i++) {
        for (const struct can_node *n = b->bus[i]->nodes; n; n = n->next) {
            if (n == node) return b->bus[i];
        }
    }
    return NULL;
}

/* The node at the point, NULL for a bus; and the bus. False: it is not on a bus now. */
static bool find_target(const struct fault *f, struct can_bus **bus, struct can_node **node)
{
    const struct control_bench *b = f->engine->bench;
    *node = NULL;
    *bus = NULL;
    if (f->point.place == FAULT_AT_BUS) *bus = b->bus[f->point.index];
    if (f->point.place == FAULT_AT_NODE) *node = b->node[f->point.unit];
    if (f->point.place == FAULT_AT_CLIENT) *node = b->clients.node(b->ctx, f->point.index);
    if (*node) *bus = bus_of(b, *node);
    return *bus != NULL;
}

static uint32_t id_mask(const struct fault *f)
{
    if (fault_given(f, FAULT_ID_MASK)) return (uint32_t)f->value[FAULT_ID_MASK];
    return fault_given(f, FAULT_ID) ? UINT32_MAX : 0;
}

static bool apply_frames(struct fault *f, int64_t t_ns)
{
    struct can_bus *bus;
    struct can_node *node;
    (void)t_ns;
    if (!find_target(f, &bus, &node)) return false;
    f->as.can = (struct can_fault){.kind = (enum can_fault_kind)f->kind->variant,
                                   .from = f->point.place == FAULT_AT_NODE ? node : NULL,
                                   .to = f->point.place == FAULT_AT_CLIENT ? node : NULL,
                                   .id = (uint32_t)f->value[FAULT_ID],
                                   .mask = id_mask(f),
                                   .probability = fault_given(f, FAULT_PROBABILITY) ? f->value[FAULT_PROBABILITY] : 1.0,
                                   .limit = (uint32_t)f->value[FAULT_FRAMES],
                                   .delay_ns = (int64_t)nearbyint(f->value[FAULT_HOLD_S] * (double)NS_PER_S),
                                   .rng = f->random};
    can_fault_add(bus, &f->as.can);
    return true;
}

static void lift_frames(struct fault *f, int64_t t_ns)
{
    struct can_bus *bus = f->as.can.bus;
    if (bus) can_fault_remove(bus, &f->as.can, t_ns);
}

static void reseed_frames(struct fault *f, uint64_t seed, int64_t t_ns)
{
    (void)t_ns;
    rng_reseed(&f->as.can.rng, seed);
}

static bool bus_off(struct fault *f, int64_t t_ns)
{
    struct can_bus *bus;
    struct can_node *node;
    if (!find_target(f, &bus, &node) || !node) return false;
    can_bus_off(bus, node->of ? node->of : node, t_ns);
    return true;
}

static bool stall_client(struct fault *f, int64_t t_ns)
{
    const struct control_bench *b = f->engine->bench;
    (void)t_ns;
    f->as.client = b->clients.node(b->ctx, f->point.index);
    return f->as.client && b->clients.stall(b->ctx, f->as.client, true);
}

static void lift_stall(struct fault *f, int64_t t_ns)
{
    const struct control_bench *b = f->engine->bench;
    (void)t_ns;
    (void)b->clients.stall(b->ctx, f->as.client, false);
}

/* What takes bits needs a bus that has them. */
static bool has_bits(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct can_node *node = f->point.place == FAULT_AT_NODE ? b->node[f->point.unit] : NULL;
    const struct can_bus *bus = f->point.place == FAULT_AT_BUS ? b->bus[f->point.index] : NULL;
    if (node) bus = bus_of(b, node);
    if (!bus || bus->cfg.bitrate_hz > 0) return true;
    snprintf(why, CONTROL_WHY_MAX, "%s: the bus is ideal (bitrate_hz 0): no bits, no error frames", f->name);
    return false;
}

#define AT(place) FAULT_BIT(FAULT_AT_##place)
#define ANY_FRAME AT(NODE) | AT(BUS) | AT(CLIENT)
#define WHICH     FAULT_BIT(FAULT_PROBABILITY) | FAULT_BIT(FAULT_FRAMES) | FAULT_BIT(FAULT_ID) | FAULT_BIT(FAULT_ID_MASK)
#define HOLD      FAULT_BIT(FAULT_HOLD_S)
#define FRAMES(v) .variant = (v), .apply = apply_frames, .lift = lift_frames, .reseed = reseed_frames

// clang-format off
static const struct fault_kind link[] = {
    {"link.drop", "Frames are lost after a successful transmission.", "gaps in the frame numbers; the board counts no loss",
     FRAMES(CAN_FAULT_DROP), .places = ANY_FRAME, .may = WHICH},
    {"link.duplicate", "Frames are received twice.", "the same frame twice in a row",
     FRAMES(CAN_FAULT_DUPLICATE), .places = ANY_FRAME, .may = WHICH},
    {"link.reorder", "Frames are received after the next one, or after hold_s.", "frame numbers, or the two halves of a sample, arrive out of order",
     FRAMES(CAN_FAULT_REORDER), .places = ANY_FRAME, .may = WHICH | HOLD},
    {"link.delay", "Frames are received hold_s later.", "the delay from sample to reception is longer than the bus load explains",
     FRAMES(CAN_FAULT_DELAY), .places = ANY_FRAME, .need = HOLD, .nonzero = HOLD, .may = WHICH},
    {"link.corrupt", "Inverts a data bit of frames without a CRC error, as a faulty gateway does.", "impossible codes, numbers or times",
     FRAMES(CAN_FAULT_ALTER), .places = ANY_FRAME, .may = WHICH},
    {"link.error_frame", "Error frames destroy frames; the sender repeats them until it is bus-off.", "error frames (socketcand and SocketCAN show them; slcan has none), frames later than they were due",
     FRAMES(CAN_FAULT_ERROR), .places = AT(NODE) | AT(BUS), .may = WHICH, .unless = "the bus is ideal, bitrate_hz 0: no bits", .fits = has_bits},
    {"link.bus_off", "The node's controller goes bus-off and recovers after 128 times 11 recessive bits.", "the node is silent for that time (1.4 ms at 1 Mbit/s), then sends its queued frames",
     .variant = BUS_OFF, .places = AT(NODE), .once = true, .unless = "the bus is ideal, bitrate_hz 0: no bits", .fits = has_bits, .apply = bus_off},
    {"link.stall", "The client stops reading.", "the program receives nothing; its frames are buffered, then dropped and counted",
     .variant = STALL, .places = AT(CLIENT), .apply = stall_client, .lift = lift_stall},
};
// clang-format on
const struct fault_table fault_link = {link, sizeof link / sizeof *link};
