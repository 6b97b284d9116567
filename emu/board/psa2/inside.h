/* A PSA-2 inside another board: that board's struct begins with a struct psa2, its lines with PSA2_LINE_ROWS, its events with
 * PSA2_EVENT_LIST. All that a PSA-2 does, and all that can fail on it, is the same there; its frames go to psa2_host. */
#ifndef PSABENCH_BOARD_PSA2_INSIDE_H
#define PSABENCH_BOARD_PSA2_INSIDE_H

#include "board/psa2/psa2.h"

// clang-format off
#define PSA2_LINE_ROWS                                                                                                  \
    [PSA2_LINE_SYNC_A] = {"SYNC_A", false}, [PSA2_LINE_SCLK] = {"SClk", false},    [PSA2_LINE_DRD_A] = {"DRD_A", true}, \
    [PSA2_LINE_DIN] = {"DIn", false},       [PSA2_LINE_DOUTX] = {"DOutX", false},  [PSA2_LINE_DOUTY] = {"DOutY", false},\
    [PSA2_LINE_DOUTZ] = {"DOutZ", false},   [PSA2_LINE_SYNC_T] = {"SYNC_T", true}, [PSA2_LINE_CST] = {"CST", true},     \
    [PSA2_LINE_DRD_T] = {"DRD_T", true},    [PSA2_LINE_DINT] = {"DInT", false},    [PSA2_LINE_DOUTT] = {"DOutT", false},\
    [PSA2_LINE_RES] = {"Res", false},       [PSA2_LINE_DATA] = {"Data", false},    [PSA2_LINE_CLK] = {"CLK", false},    \
    [PSA2_LINE_INT] = {"Int", true}

/* ---- parts: rows of board_type.parts, offsets from the beginning of the board */

enum { PSA2_KPSA_COUNTERS = 6, PSA2_ADC_COUNTERS = 15, PSA2_TEMP_COUNTERS = 20 };
extern const struct board_counter psa2_kpsa_counters[PSA2_KPSA_COUNTERS], psa2_adc_counters[PSA2_ADC_COUNTERS],
    psa2_temp_counters[PSA2_TEMP_COUNTERS];
void psa2_adc_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns);
void psa2_temp_fault(struct board *board, unsigned part, const struct chip_fault *f, int64_t t_ns);
bool psa2_adc_flip(struct board *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns);
bool psa2_temp_flip(struct board *board, unsigned part, unsigned reg, uint8_t mask, int64_t t_ns);

#define PSA2_EVERY_FAULT (BOARD_FAULT_DRDY | BOARD_FAULT_DOUT | BOARD_FAULT_SYNC | BOARD_FAULT_CLOCK)
#define PSA2_DRD_A_IS_X  "DRD_A is the pin of converter X only, this pin is not connected; use adc.x"
#define PSA2_ADC_PART(nr, axis, faults_of, why_not)                                                                     \
    {.name = "adc." axis, .label = "adc_" axis, .offset = offsetof(struct psa2, adc) + (nr) * sizeof(struct ads1282),   \
     BOARD_COUNTERS(psa2_adc_counters), .faults = (faults_of), .unless = (why_not), .registers = ADS1282_REGS,          \
     .fault = psa2_adc_fault, .flip = psa2_adc_flip}

/* point: name of its fault point; NULL: none */
#define PSA2_KPSA_PART(point, of)                                                                                       \
    {.name = (point), .label = (of), .offset = offsetof(struct psa2, counters), BOARD_COUNTERS(psa2_kpsa_counters)}
#define PSA2_CHIP_PARTS                                                                                                 \
    PSA2_ADC_PART(0, "x", PSA2_EVERY_FAULT, NULL),                                                                      \
    PSA2_ADC_PART(1, "y", PSA2_EVERY_FAULT & ~(unsigned)BOARD_FAULT_DRDY, PSA2_DRD_A_IS_X),                             \
    PSA2_ADC_PART(2, "z", PSA2_EVERY_FAULT & ~(unsigned)BOARD_FAULT_DRDY, PSA2_DRD_A_IS_X),                             \
    {.name = "tadc", .label = "adc_temp", .offset = offsetof(struct psa2, tadc), BOARD_COUNTERS(psa2_temp_counters),    \
     .faults = PSA2_EVERY_FAULT, .registers = ADS1256_REGS, .fault = psa2_temp_fault, .flip = psa2_temp_flip}
// clang-format on

/* As psa2_init(), with the lines of the board around it. */
void psa2_init_inside(struct psa2 *b, const struct psa2_profile *p, const struct board_line *lines, unsigned count,
                      const struct board_cfg *cfg, const struct board_io *io, struct sched *s);

void psa2_digest(const struct psa2 *b, struct sha256 *s); /* of all that its future depends on */

#endif
