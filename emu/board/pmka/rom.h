/* The unit's ROM (article section 3: CT and dS0 "kept in the ROM of the block", applied by measured temperature): 16-bit words
 * over a table of temperatures, the same for a host as docs/boards/pmka.md says. Pure. */
#ifndef PSABENCH_BOARD_PMKA_ROM_H
#define PSABENCH_BOARD_PMKA_ROM_H

#include "board/pmka/integrator.h"

#include <stdint.h>

#define PMKA_ROM_POINTS     7u
#define PMKA_ROM_FIRST_DEGC (-40)
#define PMKA_ROM_STEP_K     20
#define PMKA_ROM_HEAD       6u /* layout number, serial, points, first temperature, step, Ts in us */
#define PMKA_ROM_ROW        3u /* CT(+), CT(-), dS0 */
#define PMKA_ROM_WORDS      (PMKA_ROM_HEAD + 4u * PMKA_ROM_POINTS * PMKA_ROM_ROW + 1u) /* the last makes the sum 0 */
#define PMKA_ROM_LAYOUT     1u
#define PMKA_CT_LSB         (1.0 / 4194304.0) /* of CT - 1: 2^-22 */
#define PMKA_ZERO_LSB_VS    1e-10

/* Word of row `what` of an integrator at a point of the table. */
static inline unsigned pmka_rom_at(unsigned integrator, unsigned point, unsigned what)
{
    return PMKA_ROM_HEAD + (integrator * PMKA_ROM_POINTS + point) * PMKA_ROM_ROW + what;
}

static inline double pmka_rom_degc(unsigned point)
{
    return PMKA_ROM_FIRST_DEGC + PMKA_ROM_STEP_K * (double)point;
}

/* What the factory measured, rounded into words. */
struct pmka_rom_cfg {
    const struct pmka_int_cfg *integrator[4];
    double uref_v[PMKA_ROM_POINTS]; /* of the specimen at each temperature */
    double uref_nominal_v, ts_s;
    double ct_error[4]; /* relative */
    uint32_t serial;
};
void pmka_rom_burn(uint16_t word[PMKA_ROM_WORDS], const struct pmka_rom_cfg *cfg);

#endif
