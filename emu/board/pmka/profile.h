/* What is soldered, programmed or assumed on a PMKA: one plain struct a profile (proto/profiles/pmka*.yaml), each field with
 * its grade in the table of pmka/profile.c and in docs/boards/pmka.md. "sd" is the standard deviation of what specimens
 * differ by; what one has drawn is its truth. Pure. */
#ifndef PSABENCH_BOARD_PMKA_PROFILE_H
#define PSABENCH_BOARD_PMKA_PROFILE_H

#include "board/field.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum pmka_mode { PMKA_PROGRAM, PMKA_AUTONOMOUS }; /* who turns the calibration */

struct pmka_profile {
    char name[32];
    /* time */
    unsigned ts_ns;                    /* sample period, even */
    unsigned mux_step_ns;              /* between the sampling instants of X, Y, Z, K */
    unsigned hold_ns, convert_ns;      /* from the sampling instant: conversion begins, code is there */
    unsigned key_gap_ns;               /* keys move this long before and after K is sampled */
    unsigned start_ns;                 /* from Res or power-up to the first sampling instant */
    unsigned strobe_ns, strobe_min_ns; /* of the parallel bus */
    /* analog part, nominal */
    double uref_v, r_in_ohm, rr_ohm, cap_f, uc_v, limit_v, adc_range_v;
    double reset_asymmetry_ppm; /* Rr(-) over Rr(+), beside tolerances */
    /* specimens */
    double cap_tol_sd, cap_tc_ppm_per_k, cap_ageing_per_h;
    double r_tol_sd_ppm, r_tc_sd_ppm_per_k;
    double uref_tol_sd_ppm, uref_tc_sd_ppm_per_k;
    double zero_sd_v, zero_tc_sd_v_per_k;
    double uc_sd_v;
    double adc_noise_lsb, adc_offset_sd_lsb, adc_gain_sd_ppm;
    double temp_noise_k, temp_offset_sd_k;
    double rom_ct_sd_ppm; /* error of the factory's calibration, beside the ROM's resolution */
    /* rotation */
    int rotation; /* enum pmka_mode: after power-up and Res */
    unsigned beat_periods, zero_periods;
};

#define PMKA_BEAT_SPARE 6u /* periods of a beat beside those for the zero, at least */

extern const struct fields pmka_fields;

/* True if a board can run it; else a sentence that begins with the field. */
bool pmka_profile_check(const void *profile, char *why, size_t cap);

#endif
