/* A PSA-2 unit on CAN: proto/psabench.yaml behind the common node (docs/reference/protocol.md; the mapping is ours, E0).
 *
 * The board's frames become PDOs of the chosen frame form, queued when INT rises; SDO reaches every register through the
 * controller KPSA. A form or data rate whose worst-case time on the wire does not fit the bus is rejected with a reason: SDO
 * abort 08000022h, EMCY FF03h and the text in object 2031h. */
#ifndef PSABENCH_BOARD_PSA2_BOARD_H
#define PSABENCH_BOARD_PSA2_BOARD_H

#include "board/node.h"
#include "board/psa2/psa2.h"
#include "gen/psa2_od.h"

/* ---- Forms of a sample (psa2/can_form.c, pure): which frames carry it, and whether a bus can carry them. ---- */

#define PSA2_FORM_FRAMES_MAX 2u

enum psa2_sample_mode { PSA2_FREE_RUN, PSA2_ON_SYNC, PSA2_EVERY_NTH };

/* Objects 2020h.. and 2210h, 2211h. */
struct psa2_can_settings {
    uint8_t form;        /* enum psa2_form */
    uint8_t sample_mode; /* enum psa2_sample_mode */
    uint16_t nth;
    bool sync_pin;
    float zero_v[3], scale_v_per_g[3];
};

/* A block that is being filled. */
struct psa2_block {
    struct can_msg m;
    unsigned samples;
};

/* TPDOs of a form: the first, and all of them as a mask. */
unsigned psa2_form_first_tpdo(unsigned form);
unsigned psa2_form_tpdos(unsigned form);

/* Packs a sample; the number of frames in m to send now: 0 while a block is being filled. */
unsigned psa2_form_pack(unsigned form, struct psa2_block *block, const struct psa2_frame *f,
                        struct can_msg m[PSA2_FORM_FRAMES_MAX]);

/* Whether the bus can carry these settings at a data period (0: unknown, not checked); if not, the reason is in why. */
bool psa2_form_fits(const struct can_bus_cfg *bus, const struct psa2_can_settings *set, int64_t period_ns,
                    char why[BOARD_NODE_TEXT]);

/* ---- The unit ---- */

/* What the board is now. */
struct psa2_can_info {
    struct psa2_counters counters;
    int64_t period_ns; /* between frames as the converters are set; 0: unknown yet */
    uint32_t fclk_hz;  /* of the accelerometer converters */
    uint32_t serial;
    unsigned word_bits;
};

/* The board as this module needs it; tests put a fake here. board_can_cfg.type resets it. */
struct psa2_can_port {
    void *ctx;
    enum psa2_result (*submit)(void *ctx, struct psa2_request *r, int64_t t_ns);
    void (*info)(void *ctx, struct psa2_can_info *out);
};

/* Read-only outside psa2/can.c. */
struct psa2_can {
    struct board_node node; /* first */
    struct psa2_can_port port;
    struct psa2_can_settings set;
    struct psa2_frame latest;
    /* stream */
    int64_t checked_period_ns; /* data period for which node.fits holds */
    bool sync_armed;
    int64_t sync_ns;
    struct psa2_block block;
    /* controller's serial port */
    struct psa2_request request, pulse;
    bool request_busy, pulse_busy;
    uint8_t request_axis; /* whose answer is returned */
    uint32_t ticket, syncs_missed;
};

extern const struct board_type psa2_board; /* the board as the bench knows it */
extern const struct board_can psa2_can;

/* With a port other than a board's: for tests. */
void psa2_can_init(struct psa2_can *c, const struct board_can_cfg *cfg, const struct psa2_can_port *port,
                   struct can_bus *bus, struct sched *s);
struct psa2_can_port psa2_can_port(struct psa2 *b);
void psa2_can_power_down(void *can); /* leaves the bus; only the counters are kept */

/* Callbacks of the board: ctx is the struct psa2_can. */
void psa2_can_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns);
void psa2_can_fault(void *ctx, uint16_t code, int64_t t_ns);

#endif
