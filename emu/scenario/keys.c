/* Keys of the instruments, the sensors and the analog chain. */
#include "scenario/keys.h"

#define BUS(m)  offsetof(struct can_bus_cfg, m)
#define AFE(m)  offsetof(struct afe_cfg, m)
#define MEMS(m) offsetof(struct mems_g, m)

// clang-format off
static const struct field bus_rows[] = {
    {.key = "bitrate_hz",      .type = FIELD_U32, .offset = BUS(bitrate_hz),      .max = 1e6, .what = "bit rate, 10000 or more; 0: frames take no time"},
    {.key = "data_bitrate_hz", .type = FIELD_U32, .offset = BUS(data_bitrate_hz), .max = 8e6, .what = "data bit rate of FD frames with bit rate switch; 0: classic bus"},
};
const struct fields scenario_bus_fields = FIELDS(bus_rows);

static const struct field buses_rows[] = {
    {.key = "name", .type = FIELD_TEXT, .offset = offsetof(struct scenario_bus, name), .max = 16, .what = "letters, digits and _; the name for `bus` of a unit and `open` of socketcand"},
    {.type = FIELD_INLINE, .offset = offsetof(struct scenario_bus, cfg), .sub = &scenario_bus_fields},
};
const struct fields scenario_buses_fields = FIELDS_OF(struct scenario_bus, buses_rows);

static const struct field mems_rows[] = {
#define ROW(name, lo, hi, words) REAL_ROW(struct mems_g, name, lo, hi, words)
    ROW(u0_v,            -10, 10, "output without acceleration"),
    ROW(kx_v_per_g,      -10, 10, "sensitivity along the axis"),
    ROW(ky_v_per_g,      -10, 10, "sensitivity across, second axis"),
    ROW(kz_v_per_g,      -10, 10, "sensitivity across, third axis"),
    ROW(kxy_v_per_g2,    -1, 1,   "cross term"),
    ROW(kxx_v_per_g2,    -1, 1,   "square of the acceleration along the axis"),
    ROW(kyy_v_per_g2,    -1, 1,   "square of the acceleration across"),
    ROW(alpha0_deg,      -10, 10, "mounting error alpha0, added to the head's angle"),
    ROW(drift_v_per_s,   -1, 1,   "linear drift of the output from power-on"),
    ROW(noise_v_rthz,    0, 1,    "white noise, one-sided density; 0: use reading_noise_v"),
    ROW(reading_noise_v, 0, 1,    "white noise, rms of one settled reading at 1000 SPS"),
    ROW(u0_tc_v_per_k,   -1, 1,   "temperature coefficient of the output without acceleration, from 25 °C"),
    ROW(k_tc_ppm_per_k,  -1e5, 1e5, "temperature coefficient of the sensitivities"),
    ROW(bias_instability_v, 0, 1, "flicker, B of IEEE Std 952"),
    ROW(walk_v_rts,      0, 1,    "random walk, K of IEEE Std 952"),
    ROW(quantum_v,       0, 1,    "resolution of the output; 0: none"),
    ROW(low_v,           -15, 15, "lowest output; low_v and high_v both 0: no limits"),
    ROW(high_v,          -15, 15, "highest output"),
#undef ROW
};
const struct fields scenario_mems_fields = FIELDS(mems_rows);

static const struct field cvg_rows[] = {
#define ROW(name, lo, hi, words) REAL_ROW(struct cvg_dps, name, lo, hi, words)
    ROW(u0_v,               -10, 10,    "output without rotation"),
    ROW(scale_v_per_dps,    -1, 1,      "scale, V per °/s about its input axis"),
    ROW(cross_y,            -0.2, 0.2,  "sensitivity to the rate about the second axis, part of the scale"),
    ROW(cross_z,            -0.2, 0.2,  "sensitivity to the rate about the third axis, part of the scale"),
    ROW(gx_dps_per_g,       -10, 10,    "sensitivity to acceleration along the input axis"),
    ROW(gy_dps_per_g,       -10, 10,    "sensitivity to acceleration along the second axis"),
    ROW(gz_dps_per_g,       -10, 10,    "sensitivity to acceleration along the third axis"),
    ROW(square_per_dps,     -1e-3, 1e-3, "nonlinearity, square of the rate"),
    ROW(cube_per_dps2,      -1e-5, 1e-5, "nonlinearity, cube of the rate"),
    ROW(quadrature_dps,     -1e4, 1e4,  "quadrature signal, as a rate"),
    ROW(phase_deg,          -10, 10,    "phase error of the demodulator at 25 °C"),
    ROW(u0_tc_v_per_k,      -1, 1,      "temperature coefficient of the output without rotation, from 25 °C"),
    ROW(scale_tc_ppm_per_k, -1e4, 1e4,  "temperature coefficient of the scale"),
    ROW(phase_tc_deg_per_k, -1, 1,      "temperature coefficient of the phase error"),
    ROW(noise_dps_rthz,     0, 10,      "white noise, one-sided density"),
    ROW(bias_instability_dps, 0, 10,    "flicker, B of IEEE Std 952"),
    ROW(walk_dps_rts,       0, 10,      "rate random walk, K of IEEE Std 952"),
    ROW(ramp_dps_per_s,     -1, 1,      "linear drift from power-on"),
    ROW(quantum_v,          0, 1,       "resolution of the output; 0: none"),
    ROW(low_v,              -15, 15,    "lowest output; low_v and high_v both 0: no limits"),
    ROW(high_v,             -15, 15,    "highest output"),
#undef ROW
};
const struct fields scenario_cvg_fields = FIELDS(cvg_rows);

#define SERIES(m) offsetof(struct scenario_series, m)
static const char *const betweens[] = {[SERIES_LINEAR] = "linear", [SERIES_HOLD] = "hold", NULL};
static const char *const ends[] = {[SERIES_END_HOLD] = "hold", [SERIES_END_REPEAT] = "repeat", [SERIES_END_STOP] = "stop", NULL};
static const struct field series_rows[] = {
    {.key = "file",    .type = FIELD_TEXT, .offset = SERIES(file), .max = 256, .what = "CSV file; a relative path starts at the scenario's folder"},
    {.key = "column",  .type = FIELD_TEXT, .offset = SERIES(column), .max = 48, .what = "name of the column: it ends in _mps2 for a mems or quartz sensor, in _v or _a for a recorded one"},
    {.key = "start_s", .type = FIELD_REAL, .offset = SERIES(start_s), .min = -1e6, .max = 1e6, .what = "added to the times of the file"},
    {.key = "between", .type = FIELD_CHOICE, .offset = SERIES(between), .choices = betweens, .what = "between two samples: a straight line, or the earlier one's value"},
    {.key = "at_end",  .type = FIELD_CHOICE, .offset = SERIES(at_end), .choices = ends, .what = "after the last sample: its value, the file from its first sample, or no sensor"},
    {.key = "sha256",  .type = FIELD_TEXT, .offset = SERIES(sha256), .max = 65, .what = "of the file; another file is refused. \"\": any"},
};
const struct fields scenario_series_fields = FIELDS(series_rows);

static const struct field pendulum_rows[] = {
#define ROW(name, lo, hi, words) REAL_ROW(struct pendulum, name, lo, hi, words)
    ROW(mass_kg,           1e-6, 1,   "m, mass of the pendulum"),
    ROW(arm_m,             1e-5, 0.1, "L, from the hinge to the centre of mass"),
    ROW(inertia_kg_m2,     1e-12, 1e-2, "J, moment of inertia about the hinge"),
    ROW(damping_n_m_s,     0, 1,      "C, damping moment for a rate of 1 rad/s"),
    ROW(hinge_n_m_per_rad, 0, 1,      "stiffness of the hinge, beside the electrical spring"),
    ROW(pickoff_v_per_rad, 1, 1e6,    "K_DU, sensitivity of the capacitive pickoff"),
    ROW(amplifier_a_per_v, 1e-7, 1,   "K_U, gain of the phase-sensitive amplifier"),
    ROW(torquer_n_m_per_a, 1e-5, 10,  "K_DM, torquer constant"),
    ROW(gap_m,             1e-7, 1e-2, "gap of the pickoff on either side; an electrode stops the pendulum"),
    ROW(electrode_arm_m,   1e-5, 0.1, "from the hinge to the centre of the electrodes"),
#undef ROW
};
const struct fields scenario_pendulum_fields = FIELDS(pendulum_rows);

#define QUARTZ(m) offsetof(struct quartz_g, m)
static const struct field quartz_rows[] = {
#define ROW(name, lo, hi, words) REAL_ROW(struct quartz_g, name, lo, hi, words)
    ROW(scale_a_per_g,      -1, 1,      "current for one g at 30 °C"),
    ROW(scale_tc_ppm_per_k, -1e4, 1e4,  "temperature coefficient"),
    ROW(scale_curve_ppm,    -1e5, 1e5,  "greatest deviation of the scale over temperature, hot side, by the curve of the bias"),
    ROW(zero_ug,            -1e6, 1e6,  "bias at 30 °C without the temperature curve"),
    ROW(curve_ug,           -1e6, 1e6,  "greatest deviation of the bias over temperature, hot side; above 0 the article's group (a), below 0 (b)"),
    ROW(curve_centre_degc,  -100, 200,  "where the deviation changes sign"),
    ROW(curve_width_k,      1, 1000,    "distance from the centre to the greatest deviation"),
    ROW(slope_ug_per_k,     -1e4, 1e4,  "linear part of the bias over temperature"),
    ROW(play_k,             0, 100,     "half the width of the hysteresis over temperature"),
    ROW(gradient_ug_per_k,  -1e4, 1e4,  "bias per kelvin that the case is warmer than the element"),
    ROW(tilt_y_mrad,        -100, 100,  "input axis towards the sensor's y"),
    ROW(tilt_z_mrad,        -100, 100,  "input axis towards the sensor's z"),
    ROW(base_slope_arcsec_per_k, -100, 100, "linear part of the tilt towards y over temperature, from 30 °C"),
    ROW(base_curve_arcsec,  -3600, 3600, "greatest deviation of the tilt towards y over temperature, hot side, by the curve of the bias"),
    ROW(square_ug_per_g2,   -1e5, 1e5,  "square of the acceleration"),
    ROW(pendulous_ug_per_g2, 0, 1e4,    "product of the accelerations along x and y: the pendulum's deflection for one g, in µrad"),
    ROW(alpha0_deg,         -10, 10,    "mounting error alpha0, added to the head's angle"),
    ROW(glue_ug,            -1e5, 1e5,  "bias by the residual stress of the glue, before the first thermal cycle"),
    ROW(glue_ppm,           -1e5, 1e5,  "scale by the residual stress, before the first thermal cycle"),
    ROW(glue_arcsec,        -3600, 3600, "tilt towards y by the residual stress, before the first thermal cycle"),
    ROW(glue_keep,          0.001, 1,   "part of the residual stress that a thermal cycle leaves"),
    ROW(cycles,             0, 1000,    "thermal cycles that the sensor has had; those in the chamber add to them"),
    ROW(position_urad,      -1e4, 1e4,  "angle at which the pendulum was sealed in: bias by the hinge, tilt towards y"),
    ROW(hinge_ug_per_urad,  0, 1e4,     "bias per angle of the pendulum"),
    ROW(start_ug,           0, 1e5,     "scatter of the bias from power-on to power-on, rms"),
    ROW(start_ppm,          0, 1e5,     "scatter of the scale, rms"),
    ROW(start_arcsec,       0, 3600,    "scatter of the tilt towards y, rms"),
    ROW(starts,             0, 1e9,     "power-ons that the sensor has had; each draws another scatter"),
    ROW(natural_hz,         0, 1e5,     "natural frequency of the loop; 0: no lag"),
    ROW(damping,            0, 0.999,   "damping ratio of the loop"),
    ROW(noise_a_rthz,       0, 1,       "white noise, one-sided density"),
    ROW(limit_a,            0, 10,      "largest current of either sign; 0: none"),
    {.key = "pendulum", .type = FIELD_SECTION, .offset = QUARTZ(pendulum), .sub = &scenario_pendulum_fields, .present = QUARTZ(pendulum_given),
     .what = "parts of the pendulum and its loop; they decide `scale_a_per_g`, `natural_hz`, `damping`, `pendulous_ug_per_g2` and `hinge_ug_per_urad`, and a `limit_a` where the gap is less"},
#undef ROW
};
const struct fields scenario_quartz_fields = FIELDS(quartz_rows);

static const struct field afe_numbers[] = {
#define ROW(name, lo, hi, words) REAL_ROW(struct afe_cfg, name, lo, hi, words)
    ROW(load_ohm,                 1, 1e6,      "load resistor of a current output"),
    ROW(load_tol_ppm,             -1e5, 1e5,   "deviation from the nominal value"),
    ROW(load_tc_ppm_per_k,        -1e4, 1e4,   "temperature coefficient, from 25 °C"),
    ROW(divider_ratio,            1, 1000,     "volts at the load to volts at the converter"),
    ROW(divider_tol_ppm,          -1e5, 1e5,   "deviation from the nominal value"),
    ROW(divider_tc_ppm_per_k,     -1e4, 1e4,   "temperature coefficient"),
    ROW(buffer_offset_v,          -1, 1,       "offset of the buffer, referred to the load"),
    ROW(buffer_offset_tc_v_per_k, -1e-2, 1e-2, "temperature coefficient"),
    ROW(clip_v,                   0.1, 100,    "largest voltage at the load"),
    ROW(filter_hz,                0, 1e6,      "corner of the anti-alias filter; 0: none"),
    ROW(noise_v_rthz,             0, 1e-2,     "white noise at the load, one-sided density"),
#undef ROW
};
const struct fields scenario_afe_numbers = FIELDS(afe_numbers);

static const char *const inputs[] = {[AFE_CURRENT] = "current", [AFE_VOLTAGE] = "voltage", NULL};
static const struct field afe_rows[] = {
    {.key = "input", .type = FIELD_CHOICE, .offset = AFE(input), .choices = inputs, .what = "output of the sensor"},
    {.type = FIELD_INLINE, .sub = &scenario_afe_numbers},
};
const struct fields scenario_afe_fields = FIELDS(afe_rows);
// clang-format on
