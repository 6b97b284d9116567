/* What the files of the board share. Not for others. */
#ifndef PSABENCH_BOARD_GYRO_INTERNAL_H
#define PSABENCH_BOARD_GYRO_INTERNAL_H

#include "board/gyro/gyro.h"

/* gyro/run.c: the phases at this step, before the rates are computed; then the rates asked, u1 and u2. */
void gyro_run_step(struct gyro *b, int64_t t_ns);
void gyro_run_rates(struct gyro *b, int64_t t_ns, double u_radps[2]);
void gyro_run_stop(struct gyro *b, enum gyro_mode mode); /* at once, in another mode */

/* gyro/check.c: conditions. */
void gyro_condition(struct gyro *b, enum gyro_flag what, bool active, int64_t t_ns);
void gyro_report_encoder_fault(struct gyro *b, int64_t t_ns);
void gyro_past_begin(struct gyro *b); /* a mode begins: active conditions are its first */

/* gyro/check.c: at the begin of a mode; each step, when the rates are known, false: the servo must be switched off; the rate
 * of a nod in this step, about the vertical. */
void gyro_check_begin(struct gyro *b, int64_t t_ns);
bool gyro_check_step(struct gyro *b, int64_t t_ns);
double gyro_nod_radps(struct gyro *b, int64_t t_ns);

#endif
