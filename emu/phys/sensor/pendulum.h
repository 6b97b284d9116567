/* The pendulum of a quartz accelerometer and its loop: what follows from the figures of its parts (sources 5.9).
 *
 *   J phi'' + C phi' + K phi = m L a + k phi0,   K = K_DU K_U K_DM + k,   I = K_DU K_U phi
 *
 * is equation (2) of the article with the stiffness k of the hinge, which the article neglects: with k = 0 the current is that of
 * its (5), mL a / K_DM. The pickoff is a pair of capacitors; the pendulum opens one gap by what it closes the other, and the
 * difference of gaps S1 - S2 = 2 r phi is what the phase-sensitive amplifier turns into a current with its sign. Pure. */
#ifndef PSABENCH_PHYS_SENSOR_PENDULUM_H
#define PSABENCH_PHYS_SENSOR_PENDULUM_H

struct pendulum {
    double mass_kg, arm_m; /* m, L: from the hinge to the centre of mass */
    double inertia_kg_m2;  /* J */
    double damping_n_m_s;  /* C */
    double hinge_n_m_per_rad;
    double pickoff_v_per_rad; /* K_DU */
    double amplifier_a_per_v; /* K_U */
    double torquer_n_m_per_a; /* K_DM */
    double gap_m;             /* at rest, on either side */
    double electrode_arm_m;   /* from the hinge to the centre of the electrodes */
};

/* Of which an oscillator is made. */
struct pendulum_law {
    double stiffness_n_m_per_rad;
    double natural_hz, damping; /* undamped; ratio to the critical damping */
    double scale_a_per_g;
    double deflection_urad_per_g;
    double hinge_ug_per_urad; /* bias by the position in which it was sealed */
    double stop_a;            /* current at which it touches an electrode */
};

struct pickoff {
    double angle_rad;
    double gap_m[2]; /* S1, S2 */
    double delta_m;  /* S1 - S2 */
    double volt_v;   /* before the amplifier; its phase is its sign */
    double current_a;
};

/* Plausible figures (E0): 0.8 g on 8 mm, 0.049 N m/A, 0.334 N m/rad of electrical spring, 20 um gaps. */
struct pendulum pendulum_default(void);

struct pendulum_law pendulum_law(const struct pendulum *p, double g_mps2);

/* In balance with this current of its torquer. */
struct pickoff pendulum_pickoff(const struct pendulum *p, double current_a);

/* The free oscillator over dt: e'' + 2 z w e' + w^2 e = 0 for the deviation e and r = e' / w; any damping ratio z. */
void pendulum_step(double natural_hz, double damping, double dt_s, double step[2][2]);

#endif
