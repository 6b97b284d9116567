/* Keys of a flight: names, least and greatest values, what they are. Legs, parameters of legs, the aircraft, its barometer. */
#ifndef PSABENCH_PHYS_FLIGHT_RANGES_H
#define PSABENCH_PHYS_FLIGHT_RANGES_H

// clang-format off
#define FLIGHT_KIND_RANGES(X) \
    X(FLIGHT_PARK, park_s, 0.1, 86400, "parked") \
    X(FLIGHT_TAXI, taxi_m, 0.1, 20000, "straight on the ground, the change of speed included") \
    X(FLIGHT_STOP, stop_s, 0.1, 86400, "brakes, then is at rest for so long") \
    X(FLIGHT_TURN, turn_deg, -3600, 3600, "to the right; negative: to the left; coordinated in flight") \
    X(FLIGHT_TAKEOFF, takeoff_mps, 20, 200, "take-off run to this speed, then nose up") \
    X(FLIGHT_CLIMB, climb_m, 1, 20000, "up by so much") \
    X(FLIGHT_DESCEND, descend_m, 1, 20000, "down by so much") \
    X(FLIGHT_FLY, fly_s, 0.1, 86400, "straight and level, the change of speed included") \
    X(FLIGHT_SNAKE, snake_s, 1, 86400, "level, the track swings about its mean: змейка") \
    X(FLIGHT_LAND, land_mps, 20, 200, "down to the field's height, to this speed, nose down, brakes")

#define FLIGHT_PARAM_RANGES(X) \
    X(FLIGHT_SPEED_MPS, speed_mps, 0, 400, "ground speed at the end; 8 of taxi_m and land_mps; of climb_m, descend_m, fly_s 0: as it is") \
    X(FLIGHT_ACCEL_MPS2, accel_mps2, 0.05, 20, "largest acceleration along the track: taxi_m 0.8, stop_s 1, takeoff_mps 4, land_mps (brakes) 2.5; climb_m, descend_m, fly_s 1") \
    X(FLIGHT_RATE_MPS, rate_mps, 0.1, 100, "largest rate of climb or descent: climb_m 10, descend_m 8, land_mps 4") \
    X(FLIGHT_BANK_DEG, bank_deg, 0.1, FLIGHT_BANK_MAX_DEG, "bank of turn_deg in flight: 25") \
    X(FLIGHT_RADIUS_M, radius_m, 5, 5000, "radius of turn_deg on the ground: 40") \
    X(FLIGHT_AMPLITUDE_DEG, amplitude_deg, 0.1, 170, "of snake_s: 30") \
    X(FLIGHT_PERIOD_S, period_s, 5, 3600, "of snake_s: 600; the swing rises and dies away over half of it") \
    X(FLIGHT_ROLL_DEG, roll_deg, 0, 10, "sway of park_s in wind, amplitude of the roll: 0") \
    X(FLIGHT_ROLL_S, roll_s, 0.5, 60, "its period: 3; it rises and dies away over one") \
    X(FLIGHT_PITCH_DEG, pitch_deg, 0, 10, "amplitude of the pitch: 0") \
    X(FLIGHT_PITCH_S, pitch_s, 0.5, 60, "its period: 4")

#define FLIGHT_PLAN_RANGES(X) \
    X(heading_deg, -360, 360, "heading at power-on, from north, clockwise") \
    X(jerk_mps3, 0.1, 100, "largest time derivative of the acceleration (E0)") \
    X(roll_rate_dps, 0.5, 90, "largest rate of bank into and out of turns (E0)") \
    X(angle_of_attack_deg, 0, 15, "pitch above the path in flight, constant (E0)")

#define FLIGHT_BARO_RANGES(X) \
    X(lag_s, 0, 60, "lag of first order; 0: none (E0)") \
    X(scale_ppm, -1e5, 1e5, "scale error") \
    X(offset_m, -1000, 1000, "offset at power-on") \
    X(drift_m_per_h, -1000, 1000, "drift of the offset")
// clang-format on

#endif
