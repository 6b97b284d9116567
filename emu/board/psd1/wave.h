/* Edges of a PSD-1 that come in long rows, as the board keeps them: included by board/psd1/psd1.h, psd1/wave.c makes them. */
#ifndef PSABENCH_BOARD_PSD1_WAVE_H
#define PSABENCH_BOARD_PSD1_WAVE_H

#include "trace/trace.h"

#include <stdbool.h>
#include <stdint.h>

#define PSD1_BITS_MAX  24u
#define PSD1_STEPS_MAX (5u * PSD1_BITS_MAX + 8u)

/* One step of a frame's edges; its bit of the word decides about SDAT: -1: none, PSD1_BITS_MAX: the rest level after it. */
struct psd1_wave_step {
    struct trace_step s; /* t_ns from the fall of RFx or TFS */
    int8_t bit;
};

/* The edges of a frame of 16 or 24 SCLK. */
struct psd1_wave_form {
    unsigned count;
    struct psd1_wave_step step[PSD1_STEPS_MAX];
};
enum psd1_form { PSD1_FORM_READ16, PSD1_FORM_READ24, PSD1_FORM_WRITE24, PSD1_FORMS };

/* What of the lines is computed while watched. */
struct psd1_wave {
    struct psd1_wave_form form[PSD1_FORMS][2]; /* without and with 1M25 */
    bool on;                                   /* clock_on or frame_on */
    bool clock_on, frame_on;
    int64_t clock_ns; /* next edge of 1M25 to report */
    unsigned next;    /* next step of the frame */
    bool sdat;        /* as reported */
};

/* The frame on SCLK and SDAT. */
struct psd1_frame {
    bool active;
    enum psd1_form form;
    uint32_t word;
    int64_t t_ns; /* RFx or TFS falls */
};

#endif
