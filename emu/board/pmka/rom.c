#include "board/pmka/rom.h"

#include <math.h>

static uint16_t round_to_int16(double x)
{
    const double r = floor(x + 0.5);
    return (uint16_t)(int16_t)(r > 32767.0 ? 32767.0 : r < -32768.0 ? -32768.0 : r);
}

static void burn_point(uint16_t *word, const struct pmka_rom_cfg *cfg, unsigned i, unsigned point)
{
    const struct pmka_int_cfg *c = cfg->integrator[i];
    const double degc = pmka_rom_degc(point);
    for (unsigned sign = 0; sign < 2; sign++) {
        const double ct =
            pmka_int_ct(c, (enum pmka_sign)sign, cfg->uref_v[point], cfg->uref_nominal_v, degc) + cfg->ct_error[i];
        word[pmka_rom_at(i, point, sign)] = round_to_int16((ct - 1.0) / PMKA_CT_LSB);
    }
    word[pmka_rom_at(i, point, 2)] = round_to_int16(pmka_int_zero_v(c, degc) * cfg->ts_s / PMKA_ZERO_LSB_VS);
}

void pmka_rom_burn(uint16_t word[PMKA_ROM_WORDS], const struct pmka_rom_cfg *cfg)
{
    const uint16_t head[PMKA_ROM_HEAD] = {PMKA_ROM_LAYOUT, (uint16_t)cfg->serial,
                                          PMKA_ROM_POINTS, (uint16_t)(int16_t)PMKA_ROM_FIRST_DEGC,
                                          PMKA_ROM_STEP_K, round_to_int16(cfg->ts_s * 1e6)};
    for (unsigned i = 0; i < PMKA_ROM_HEAD; i++) word[i] = head[i];
    for (unsigned i = 0; i < 4; i++)
        for (unsigned point = 0; point < PMKA_ROM_POINTS; point++) burn_point(word, cfg, i, point);
    uint16_t sum = 0;
    for (unsigned i = 0; i + 1 < PMKA_ROM_WORDS; i++) sum = (uint16_t)(sum + word[i]);
    word[PMKA_ROM_WORDS - 1] = (uint16_t)(0u - sum);
}
