"""Random schedules of faults and host behaviours, judged by the requirements: what no one thought of writing down."""
