#include "fault/args.h"

#define TIME_MAX_S 1e6

static const char *const levels[] = {"low", "high", NULL};

// clang-format off
const struct control_arg fault_args[FAULT_ARGS + 1] = {
    [FAULT_KIND] = {"kind", CONTROL_NAME, .what = "kind from fault.kinds"},
    [FAULT_POINT] = {"point", CONTROL_NAME, .what = "point from fault.points"},
    [FAULT_AT_S] = {"at_s", CONTROL_REAL, true, "s", 0, TIME_MAX_S, .what = "simulated time of the fault; default: now; with after: time from which events count"},
    [FAULT_AFTER] = {"after", CONTROL_EVENT, true, .what = "board event that triggers the fault"},
    [FAULT_COUNT] = {"count", CONTROL_COUNT, true, NULL, 1, 1e9, .what = "number of the triggering event; default: 1"},
    [FAULT_SINCE] = {"since", CONTROL_EVENT, true, .what = "event that restarts the count"},
    [FAULT_UNIT] = {"unit", CONTROL_UNIT, true, .what = "unit of the events; default: the point's"},
    [FAULT_DELAY_S] = {"delay_s", CONTROL_REAL, true, "s", 0, 1000, .what = "delay from event to fault"},
    [FAULT_FOR_S] = {"for_s", CONTROL_REAL, true, "s", 0, TIME_MAX_S, .what = "duration; default: 0, until fault.clear"},
    [FAULT_OUT_V] = {"out_v", CONTROL_REAL, true, "V", -15, 15, .what = "sensor output (for a current output, at the load)"},
    [FAULT_BIAS_V] = {"bias_v", CONTROL_REAL, true, "V", -15, 15, .what = "bias added to the sensor output", .least = FAULT_LEAST_V},
    [FAULT_DRIFT_V_PER_S] = {"drift_v_per_s", CONTROL_REAL, true, "V/s", -1000, 1000, .what = "rate of change of the sensor output", .least = FAULT_LEAST_V},
    [FAULT_SCALE_PPM] = {"scale_ppm", CONTROL_REAL, true, "ppm", -1e7, 1e7, .what = "scale factor error; -1000000: no sensitivity", .least = FAULT_LEAST_PPM},
    [FAULT_RMS_V] = {"rms_v", CONTROL_REAL, true, "V", FAULT_LEAST_V, 10, .what = "noise rms of a settled reading at 1000 SPS"},
    [FAULT_LOW_V] = {"low_v", CONTROL_REAL, true, "V", -15, 15, .what = "minimum sensor output"},
    [FAULT_HIGH_V] = {"high_v", CONTROL_REAL, true, "V", -15, 15, .what = "maximum sensor output"},
    [FAULT_REFERENCE_PPM] = {"reference_ppm", CONTROL_REAL, true, "ppm", -500000, 1e6, .what = "error of the converter's reference voltage", .least = FAULT_LEAST_PPM},
    [FAULT_DRIFT_PPM_PER_S] = {"drift_ppm_per_s", CONTROL_REAL, true, "ppm/s", FAULT_LEAST_PPM, 1e6, .what = "rate of change of that error"},
    [FAULT_AMPLITUDE_V] = {"amplitude_v", CONTROL_REAL, true, "V", FAULT_LEAST_V, 10, .what = "ripple amplitude at the load"},
    [FAULT_FREQUENCY_HZ] = {"frequency_hz", CONTROL_REAL, true, "Hz", 0.1, 1e7, .what = "frequency of the ripple; above 100 Hz of analog.ripple alone"},
    [FAULT_LEVEL] = {"level", CONTROL_CHOICE, true, .what = "logic level of the line or pin", .choices = levels},
    [FAULT_REGISTER] = {"register", CONTROL_COUNT, true, NULL, 0, 255, .what = "register address in the chip"},
    [FAULT_MASK] = {"mask", CONTROL_COUNT, true, NULL, 1, 255, .what = "mask of the bits to invert"},
    [FAULT_CLOCK_PPM] = {"clock_ppm", CONTROL_REAL, true, "ppm", -FAULT_PPM_MAX, FAULT_PPM_MAX, .what = "clock frequency error"},
    [FAULT_WIDTH_NS] = {"width_ns", CONTROL_COUNT, true, "ns", 1, 1e9, .what = "pulse width"},
    [FAULT_PULSE] = {"pulse", CONTROL_COUNT, true, NULL, 1, 128, .what = "pulse number in the frame, from 1"},
    [FAULT_RATE_HZ] = {"rate_hz", CONTROL_REAL, true, "Hz", 0.001, 1e6, .what = "mean pulse rate"},
    [FAULT_PROBABILITY] = {"probability", CONTROL_REAL, true, NULL, 1e-6, 1, .what = "probability per frame; default: 1"},
    [FAULT_FRAMES] = {"frames", CONTROL_COUNT, true, NULL, 1, 1e9, .what = "number of frames to affect; default: all"},
    [FAULT_ID] = {"can_id", CONTROL_COUNT, true, NULL, 0, 536870911, .what = "CAN identifier to match; default: any"},
    [FAULT_ID_MASK] = {"can_id_mask", CONTROL_COUNT, true, NULL, 0, 536870911, .what = "mask of the identifier bits to compare; default: all"},
    [FAULT_HOLD_S] = {"hold_s", CONTROL_REAL, true, "s", 0, 10, .what = "delay of the frame"},
    [FAULT_DROP_V] = {"drop_v", CONTROL_REAL, true, "V", 1e-3, 100, .what = "voltage drop"},
    [FAULT_DRIFT_DEGPH] = {"drift_degph", CONTROL_REAL, true, "deg/h", -1000, 1000, .what = "additional gyroscope drift", .least = 1e-3},
    [FAULT_RATE_PART] = {"rate_part", CONTROL_REAL, true, NULL, 1e-6, 0.99, .what = "part of the chamber's ramp that the air makes; 1e-6: it sticks"},
    [FAULT_READOUT_K] = {"readout_k", CONTROL_REAL, true, "K", -200, 200, .what = "error of the chamber's thermometer", .least = 0.1},
    [FAULT_RIPPLE_DPS] = {"ripple_dps", CONTROL_REAL, true, "deg/s", 1e-3, 100, .what = "amplitude of the rate of a table's axis"},
    [FAULT_OVERSHOOT_K] = {"overshoot_k", CONTROL_REAL, true, "K", 0.1, 50, .what = "how far the chamber's air goes past its set point"},
    [FAULT_SLIP_DEG] = {"slip_deg", CONTROL_REAL, true, "deg", -10, 10, .what = "by which each turn leaves the mount short of the head's scale", .least = 1e-3},
    [FAULT_LATE_S] = {"late_s", CONTROL_REAL, true, "s", 1e-3, 3600, .what = "delay of an instrument's answers, simulated time"},
    [FAULT_RAMP_MPS] = {"ramp_mps", CONTROL_REAL, true, "m/s", -1000, 1000, .what = "speed at which a receiver's position runs away", .least = 0.01},
    [FAULT_JUMP_M] = {"jump_m", CONTROL_REAL, true, "m", -1e5, 1e5, .what = "step of a receiver's position", .least = 0.1},
    [FAULT_AZIMUTH_DEG] = {"azimuth_deg", CONTROL_REAL, true, "deg", -360, 360, .what = "direction from north, clockwise; default: 0, north"},
    [FAULT_WEEKS] = {"weeks", CONTROL_REAL, true, NULL, -1024, 1024, .what = "whole weeks by which a receiver's date is off; -1024: a rollover of the GPS week", .least = 1},
    [FAULT_LIMIT_DPS] = {"limit_dps", CONTROL_REAL, true, "deg/s", 1e-3, 10000, .what = "rate that a gyro's counter does not exceed"},
    [FAULT_LOCK_IN_DEGPH] = {"lock_in_degph", CONTROL_REAL, true, "deg/h", 1e-3, 360000, .what = "rate by which a gyro's zone of lock-in is wider"},
};
// clang-format on
_Static_assert(FAULT_ARGS <= CONTROL_ARGS_MAX, "all values of a command fit");
