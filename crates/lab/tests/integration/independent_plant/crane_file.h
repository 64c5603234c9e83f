/* The numbers of the crane: read from a crane file, independently of the Rust parser. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

/* The keys of the crane file that count here, each with its unit in SI. */
#define MM 1e-3
#define BAR 1e5
#define LITRE 1e-3
#define KEYS(X) \
    X(mount_x, "geometry.mount_x_mm", MM) X(mount_y, "geometry.mount_y_mm", MM)                                  \
    X(base_x, "geometry.base_x_mm", MM) X(base_y, "geometry.base_y_mm", MM)                                      \
    X(shortest, "geometry.shortest_mm", MM) X(length, "boom.length_mm", MM) X(boom_mass, "boom.mass_kg", 1)      \
    X(modulus, "boom.youngs_modulus_gpa", 1e9) X(second_moment, "boom.second_moment_cm4", 1e-8)                  \
    X(damping, "boom.damping_ratio", 1) X(gravity, "boom.gravity_m_s2", 1) X(payload, "payload.mass_kg", 1)      \
    X(payload_x, "payload.x_mm", MM) X(payload_y, "payload.y_mm", MM)                                            \
    X(payload_inertia, "payload.inertia_kgm2", 1) X(piston, "cylinder.piston_mm", MM)                            \
    X(rod, "cylinder.rod_mm", MM) X(stroke, "cylinder.stroke_mm", MM)                                            \
    X(dead_a, "cylinder.dead_volume_a_l", LITRE) X(dead_b, "cylinder.dead_volume_b_l", LITRE)                    \
    X(stop_stiffness, "cylinder.stop_stiffness_n_per_mm", 1e3)                                                   \
    X(stop_damping, "cylinder.stop_damping_s_per_m", 1) X(viscous, "friction.viscous_ns_per_m", 1)               \
    X(coulomb, "friction.coulomb_n", 1) X(stiction, "friction.stiction_n", 1)                                    \
    X(stribeck_velocity, "friction.stribeck_velocity_mm_s", MM)                                                  \
    X(bristle_stiffness, "friction.bristle_stiffness_n_per_mm", 1e3)                                             \
    X(bristle_damping, "friction.bristle_damping_ns_per_m", 1) X(beta_max, "oil.bulk_modulus_max_mpa", 1e6)      \
    X(beta_min, "oil.bulk_modulus_min_mpa", 1e6) X(transition, "oil.transition_bar", BAR)                        \
    X(width, "oil.transition_width_bar", BAR) X(vapour, "oil.vapour_pressure_bar", BAR)                          \
    X(air_shift, "oil.air_shift_bar", BAR) X(dissolving, "oil.air_dissolving_s", 1)                              \
    X(releasing, "oil.air_releasing_s", 1) X(laminar_drop, "oil.laminar_drop_bar", BAR)                          \
    X(displacement, "pump.displacement_cm3", 1e-6) X(flow_gain, "pump.flow_gain", 1)                             \
    X(internal, "pump.internal_leakage_m3_s_sqrtpa", 1) X(case_a, "pump.case_leakage_a_m3_s_sqrtpa", 1)          \
    X(case_b, "pump.case_leakage_b_m3_s_sqrtpa", 1) X(volume_pa, "pump.volume_a_l", LITRE)                       \
    X(volume_pb, "pump.volume_b_l", LITRE) X(slip, "pump.slip_l_min_per_bar", LITRE / 60 / BAR)                  \
    X(slip_speed, "pump.slip_cm3_per_rev_bar", 1e-6 / BAR)                                                       \
    X(holding_k, "holding_valve.flow_coefficient_m3_s_sqrtpa", 1)                                                \
    X(holding_crack, "holding_valve.cracking_bar", BAR) X(holding_open, "holding_valve.opening_bar", BAR)        \
    X(holding_ratio, "holding_valve.pilot_ratio", 1) X(return_k, "return_valve.flow_coefficient_m3_s_sqrtpa", 1) \
    X(return_crack, "return_valve.cracking_bar", BAR) X(return_open, "return_valve.opening_bar", BAR)            \
    X(return_ratio, "return_valve.pilot_ratio", 1) X(check_k, "check_valve.flow_coefficient_m3_s_sqrtpa", 1)     \
    X(check_crack, "check_valve.cracking_bar", BAR) X(check_open, "check_valve.opening_bar", BAR)                \
    X(filter, "lines.filter_m3_s_sqrtpa", 1) X(bleed, "lines.bleed_orifice_m3_s_sqrtpa", 1)                      \
    X(shell, "accumulator.volume_l", LITRE) X(precharge, "accumulator.precharge_bar", BAR)                       \
    X(working, "accumulator.working_bar", BAR) X(exponent, "accumulator.polytropic_exponent", 1)                 \
    X(residual, "accumulator.residual_l", LITRE) X(atmosphere, "accumulator.atmosphere_bar", BAR)                \
    X(max_speed, "motor.max_speed_rpm", 1.0 / 60) X(slew, "motor.slew_rpm_per_s", 1.0 / 60)                      \
    X(drive_bandwidth, "drive.bandwidth_hz", 2 * PI) X(drive_damping, "drive.damping_ratio", 1)                  \
    X(position_noise, "sensors.position_noise_mm", MM)                                                           \
    X(position_resolution, "sensors.position_resolution_mm", MM) X(span, "sensors.pressure_span_bar", BAR)       \
    X(pressure_noise, "sensors.pressure_noise_percent", 1e-2) X(bits, "sensors.pressure_bits", 1)                \
    X(bandwidth, "sensors.bandwidth_hz", 2 * PI) X(seed, "virtual.seed", 1)                                      \
    X(period, "controller.control_period_ms", 1e-3) X(start, "motion.start_mm", MM)                              \
    X(rod_side, "start.rod_side_bar", BAR) X(preload, "start.preload_percent", 1e-2)

#define FIELD(field, path, unit) double field;
#define ROW(field, path, unit) { path, unit, &c.field },
static struct { KEYS(FIELD) double step; } c;
static const struct { const char *path; double unit; double *to; } keys[] = {
    KEYS(ROW) { "integrator.step_us", 1e-6, &c.step } }; /* the last is this program's own */
enum { KEY_COUNT = sizeof keys / sizeof keys[0] };

static void fail(const char *what, const char *which)
{
    fprintf(stderr, "crane: %s: %s\n", what, which);
    exit(2);
}

static int set(const char *path, double value)
{
    int i = 0;
    while (i < KEY_COUNT && strcmp(keys[i].path, path) != 0) i++;
    if (i < KEY_COUNT) *keys[i].to = value * keys[i].unit;
    return i < KEY_COUNT;
}

/* A key that neither the file nor an assignment gives is an error. */
static void read_crane(const char *file, int count, char **assignments)
{
    char line[1024], section[64] = "", name[64], path[130];
    double value;
    int i;
    FILE *f = fopen(file, "r");
    if (f == NULL) fail("cannot read the crane file", file);
    for (i = 0; i < KEY_COUNT; i++) *keys[i].to = NAN;
    c.step = 20e-6;
    while (fgets(line, sizeof line, f) != NULL) {
        if (sscanf(line, "[%63[a-z0-9_]]", section) == 1) continue;
        if (sscanf(line, "%63[a-z0-9_] = { value = %lf", name, &value) != 2) continue;
        snprintf(path, sizeof path, "%s.%s", section, name);
        set(path, value);
    }
    fclose(f);
    for (i = 0; i < count; i++) {
        if (sscanf(assignments[i], "%129[a-z0-9_.]=%lf", path, &value) != 2 || !set(path, value))
            fail("not an assignment section.key=VALUE of a known key", assignments[i]);
    }
    for (i = 0; i < KEY_COUNT; i++)
        if (isnan(*keys[i].to)) fail("the crane file lacks the key", keys[i].path);
}
