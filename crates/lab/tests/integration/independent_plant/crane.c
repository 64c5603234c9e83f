/*
 * A crane simulated independently of the Rust model: written from docs/reference/theory.md, docs/reference/virtual-crane.md and
 * the keys of the crane file, and sharing no code with the model. The boom is an Euler-Bernoulli beam in
 * assumed modes (Ritz) and no chain of rigid segments; every volume of oil dissolves its own air; the
 * integrator is the explicit Runge-Kutta method of order 4 with a fixed step.
 *
 * Left out: elastic base, pump ripple, torque of the motor, temperature, lag of the switching valve. The beam
 * is small in deflection: Coriolis and centripetal terms of the deflection and the beam's axial load are left out.
 *
 *   crane FILE [section.key=VALUE ...]     FILE: a crane file; further values replace those of the file
 *
 * One request a line on the standard input, SI units:
 *   run SPEED      advances by one control period with the motor speed [rev/s]; answers with a line of readings
 *   payload MASS   changes the payload [kg], at once
 *   valve U        energises (1) or releases (0) the 3/2 valve that pilots the load-holding valves
 *   impulse RATE   adds to the boom's angular velocity [rad/s]
 *
 * A line of readings, the first at the start: piston position [m], the pressures of piston side, rod side, pump
 * side A, pump side B and accumulator [Pa], motor speed [rev/s], all as read, then the true piston position [m].
 */
#include "crane_file.h"
#include <stdint.h>

#define SHAPES 6 /* the rigid rotation about the bearing, and the bending shapes */
#define READINGS 7

/* The state. AIR: by how much the air that each node's oil has dissolved lowers its transition pressure. */
enum { U = 0, DU = U + SHAPES, BRISTLE = DU + SHAPES, P_A, P_B, P_PA, P_PB, P_ACC, V_GAS, AIR, MOTOR = AIR + 4,
       MOTOR_RATE, STATES };

/* --- boom ---
 * Transverse displacement in a frame that turns with the line from the bearing through the axis at the mount:
 * shape 0 is x, the rotation. Shape i > 0 has the curvature inner x/m up to the mount m and
 * outer (1 - (x - m)/(L - m))^power beyond it: shapes 1 and 2 hold every deflection by a force at the tip
 * and a force and a moment at the mount, 3 a moment beyond, 4 and 5 distributed loads and higher modes. */
static const struct { double inner, outer, power; } shapes[SHAPES] = {
    { 0, 0, 0 }, { 1, 1, 1 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 1, 2 }, { 0, 1, 3 } };

static double curvature(int i, double x)
{
    const double m = c.mount_x, left = 1 - (x - m) / (c.length - m);
    return x < m ? shapes[i].inner * x / m : shapes[i].outer * pow(left, shapes[i].power);
}

static double slope(int i, double x)
{
    const double m = c.mount_x, a = shapes[i].inner, out = c.length - m, k = shapes[i].power + 1;
    if (i == 0) return 1;
    if (x < m) return a * (x * x / (2 * m) - m / 6);
    return a * m / 3 + shapes[i].outer * out / k * (1 - pow(1 - (x - m) / out, k));
}

static double deflection(int i, double x)
{
    const double m = c.mount_x, a = shapes[i].inner, out = c.length - m, k = shapes[i].power + 1;
    const double eta = (x - m) / out;
    if (i == 0) return x;
    if (x < m) return a * (x * x * x / (6 * m) - m * x / 6);
    return a * m / 3 * (x - m) + shapes[i].outer * out * out / k * (eta - (1 - pow(1 - eta, k + 1)) / (k + 1));
}

static double stiffness[SHAPES][SHAPES], beam_mass[SHAPES][SHAPES], beam_moment[SHAPES], mobility[SHAPES][SHAPES];
static double moment[SHAPES], end_slope[SHAPES], mount_slope[SHAPES], damping_time, inertia_per_kg;

/* By Gauss and Jordan. The matrices are positive definite: no exchange of rows is needed. */
static void invert(double a[SHAPES][SHAPES], double inverse[SHAPES][SHAPES], int first)
{
    int i, j, k;
    for (i = first; i < SHAPES; i++) for (j = first; j < SHAPES; j++) inverse[i][j] = i == j;
    for (k = first; k < SHAPES; k++) {
        const double pivot = a[k][k];
        for (j = first; j < SHAPES; j++) a[k][j] /= pivot, inverse[k][j] /= pivot;
        for (i = first; i < SHAPES; i++) {
            const double factor = a[i][k];
            if (i == k) continue;
            for (j = first; j < SHAPES; j++) {
                a[i][j] -= factor * a[k][j];
                inverse[i][j] -= factor * inverse[k][j];
            }
        }
    }
}

/* The boom with the payload on it: mass matrix, its inverse and the moments of weight. */
static void load(double mass)
{
    double m[SHAPES][SHAPES];
    int i, j;
    c.payload = mass;
    for (i = 0; i < SHAPES; i++) {
        const double at = deflection(i, c.payload_x);
        moment[i] = beam_moment[i] + mass * at;
        for (j = 0; j < SHAPES; j++)
            m[i][j] = beam_mass[i][j] + mass * at * deflection(j, c.payload_x)
                + mass * (c.payload_y * c.payload_y + inertia_per_kg) * end_slope[i] * end_slope[j];
    }
    /* stiffness-proportional, such that the boom held at the mount has the given ratio in its first shape */
    damping_time = 2 * c.damping / sqrt(stiffness[1][1] / m[1][1]);
    invert(m, mobility, 0);
}

static void build_boom(void)
{
    const double line_mass = c.boom_mass / c.length, rigidity = c.modulus * c.second_moment;
    const int n = 400; /* Simpson's rule, on either side of the mount, where the curvature jumps */
    int part, k, i, j;
    inertia_per_kg = c.payload > 0 ? c.payload_inertia / c.payload : 0;
    for (part = 0; part < 2; part++) {
        const double from = part ? c.mount_x : 0, to = part ? c.length : c.mount_x * (1 - 1e-12);
        for (k = 0; k <= n; k++) {
            const double x = from + (to - from) * k / n;
            const double w = (to - from) / n / 3 * (k == 0 || k == n ? 1 : k % 2 ? 4 : 2);
            for (i = 0; i < SHAPES; i++) {
                beam_moment[i] += w * line_mass * deflection(i, x);
                for (j = 0; j < SHAPES; j++) {
                    beam_mass[i][j] += w * line_mass * deflection(i, x) * deflection(j, x);
                    if (i && j) stiffness[i][j] += w * rigidity * curvature(i, x) * curvature(j, x);
                }
            }
        }
    }
    for (i = 0; i < SHAPES; i++) {
        end_slope[i] = slope(i, c.payload_x);
        mount_slope[i] = i ? slope(i, c.mount_x) : 0;
    }
    load(c.payload);
}

/* Length of the cylinder, and its derivatives by the shapes. */
static double cylinder(const double *u, double by[SHAPES])
{
    double turned = 0, x, y, rx, ry, length, sine = sin(u[0]), cosine = cos(u[0]);
    int i;
    for (i = 1; i < SHAPES; i++) turned += mount_slope[i] * u[i];
    x = c.mount_x - c.mount_y * turned, y = c.mount_y;
    rx = cosine * x - sine * y - c.base_x, ry = sine * x + cosine * y - c.base_y;
    length = sqrt(rx * rx + ry * ry);
    by[0] = (rx * (-sine * x - cosine * y) + ry * (cosine * x - sine * y)) / length;
    for (i = 1; i < SHAPES; i++) by[i] = -c.mount_y * mount_slope[i] * (rx * cosine + ry * sine) / length;
    return length;
}

/* Generalised forces of weight. */
static void weigh(const double *u, double force[SHAPES])
{
    const double sine = sin(u[0]), cosine = cos(u[0]), lever = c.payload * c.payload_y;
    int i;
    for (i = 0; i < SHAPES; i++) force[i] = -c.gravity * (cosine * moment[i] - sine * lever * end_slope[i]);
    for (i = 1; i < SHAPES; i++)
        force[0] += c.gravity * u[i] * (sine * moment[i] + cosine * lever * end_slope[i]);
}

/* --- hydraulics --- */
static double bulk_modulus(double p, double air)
{
    return (c.beta_max + c.beta_min) / 2 + (c.beta_max - c.beta_min) / 2 * tanh((p - c.transition + air) / c.width);
}

static double root(double drop)
{
    const double x = drop / c.laminar_drop;
    if (fabs(x) > 1) return drop > 0 ? sqrt(drop) : -sqrt(-drop);
    return sqrt(c.laminar_drop) * x * (5 - x * x) / 4;
}

static double opening(double drop, double crack, double open)
{
    const double x = (drop - crack) / (open - crack);
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

/* Pilot-operated check valve, free from port 1 to port 2. */
static double piloted(double p_1, double p_2, double pilot, double ratio, double crack, double open)
{
    return opening(p_1 - p_2 + ratio * fmax(pilot - p_1, 0), crack, open);
}

static double series(double a, double b, double d)
{
    return a <= 0 || b <= 0 || d <= 0 ? 0 : 1 / sqrt(1 / (a * a) + 1 / (b * b) + 1 / (d * d));
}

static double valve = 1, set_point, area_a, area_b;

static void derive(const double *s, double *d)
{
    double by[SHAPES], force[SHAPES], p[5], beta[5], v = 0, friction, push;
    const double x = cylinder(s + U, by) - c.shortest, n = s[MOTOR];
    const double unrestricted = 1e9; /* in series with it a restriction is itself */
    int i, j;
    for (i = 0; i < 5; i++) p[i] = fmax(s[P_A + i], c.vapour); /* below vapour pressure the coordinate counts a cavity */
    for (i = 0; i < 5; i++) beta[i] = bulk_modulus(p[i], i < 4 ? s[AIR + i] : 0);
    for (i = 0; i < SHAPES; i++) v += by[i] * s[DU + i];
    {
        const double g = c.coulomb + c.stiction * exp(-(v / c.stribeck_velocity) * (v / c.stribeck_velocity));
        d[BRISTLE] = g > 0 ? v - c.bristle_stiffness * fabs(v) * s[BRISTLE] / g : 0;
        friction = c.viscous * v;
        if (g > 0) friction += c.bristle_stiffness * s[BRISTLE] + c.bristle_damping * d[BRISTLE];
    }
    push = area_a * p[0] - area_b * p[1] - friction;
    if (x < 0) push -= c.stop_stiffness * x * fmax(0, 1 - c.stop_damping * v);
    if (x > c.stroke) push -= c.stop_stiffness * (x - c.stroke) * fmax(0, 1 + c.stop_damping * v);
    weigh(s + U, force);
    for (i = 0; i < SHAPES; i++) {
        force[i] += push * by[i];
        for (j = 1; i && j < SHAPES; j++) force[i] -= stiffness[i][j] * (s[U + j] + damping_time * s[DU + j]);
    }
    for (i = 0; i < SHAPES; i++) {
        d[U + i] = s[DU + i];
        d[DU + i] = 0;
        for (j = 0; j < SHAPES; j++) d[DU + i] += mobility[i][j] * force[j];
    }
    {
        const double a = p[0], b = p[1], pa = p[2], pb = p[3], acc = p[4];
        const double pilot = acc + valve * (fmax(a, b) - acc);
        const double k_a = c.holding_k * piloted(pa, a, pilot, c.holding_ratio, c.holding_crack, c.holding_open);
        const double k_b = c.holding_k * piloted(pb, b, pilot, c.holding_ratio, c.holding_crack, c.holding_open);
        const double k_7a = c.return_k * piloted(acc, pa, pb, c.return_ratio, c.return_crack, c.return_open);
        const double k_7b = c.return_k * piloted(acc, pb, pa, c.return_ratio, c.return_crack, c.return_open);
        const double q_a = k_a * root(pa - a), q_b = k_b * root(b - pb), q_p = n * c.displacement;
        const double q_int = c.internal * root(pa - pb) + (c.slip + c.slip_speed * fabs(n)) * (pa - pb);
        const double q_ext_a = c.case_a * root(pa - acc), q_ext_b = c.case_b * root(pb - acc);
        const double q_1 = series(c.bleed, k_7a, unrestricted) * root(pa - acc);
        const double q_out = c.check_k * opening(acc - pb, c.check_crack, c.check_open) * root(acc - pb);
        const double k_8 = c.check_k * opening(pb - acc, c.check_crack, c.check_open);
        const double q_in = series(c.filter, k_7b, k_8) * root(pb - acc);
        const double q_acc = q_ext_a + q_ext_b - q_out + q_1 + q_in;
        const double v_a = c.dead_a + x * area_a, v_b = c.dead_b + (c.stroke - x) * area_b;
        const double gas = s[V_GAS] / (c.exponent * (acc + c.atmosphere));
        d[P_A] = beta[0] / v_a * (q_a - v * area_a);
        d[P_B] = beta[1] / v_b * (v * area_b - q_b);
        /* a cavity in a volume that grows: no oil is lost */
        if (s[P_A] < c.vapour && v > 0) d[P_A] += (c.vapour - s[P_A]) * v * area_a / v_a;
        if (s[P_B] < c.vapour && v < 0) d[P_B] -= (c.vapour - s[P_B]) * v * area_b / v_b;
        d[P_PA] = beta[2] / c.volume_pa * (c.flow_gain * q_p - q_int - q_ext_a - q_1 - q_a);
        d[P_PB] = beta[3] / c.volume_pb * (q_b + q_out + q_int - q_p - q_ext_b - q_in);
        d[P_ACC] = q_acc / ((c.shell - s[V_GAS]) / beta[4] + gas);
        d[V_GAS] = -d[P_ACC] * gas;
    }
    for (i = 0; i < 4; i++) {
        const double end = c.air_shift * fmin(fmax(p[i], 0) / c.transition, 1);
        d[AIR + i] = (end - s[AIR + i]) / (end > s[AIR + i] ? c.dissolving : c.releasing);
    }
    d[MOTOR] = s[MOTOR_RATE];
    d[MOTOR_RATE] = c.drive_bandwidth * (c.drive_bandwidth * (set_point - n) - 2 * c.drive_damping * s[MOTOR_RATE]);
}

/* At rest at a piston position, weight on the cylinder and no friction. */
static void start(double *s)
{
    double by[SHAPES], weight[SHAPES], rigidity[SHAPES][SHAPES], flexibility[SHAPES][SHAPES], force = 0;
    int round, i, j;
    memcpy(rigidity, stiffness, sizeof rigidity);
    invert(rigidity, flexibility, 1);
    memset(s, 0, STATES * sizeof *s);
    for (round = 0; round < 100; round++) {
        s[U] += (c.shortest + c.start - cylinder(s + U, by)) / by[0];
        cylinder(s + U, by);
        weigh(s + U, weight);
        force = -weight[0] / by[0];
        for (i = 1; i < SHAPES; i++)
            for (s[U + i] = 0, j = 1; j < SHAPES; j++) s[U + i] += flexibility[i][j] * (weight[j] + force * by[j]);
    }
    s[P_B] = c.rod_side;
    s[P_A] = (force + area_b * c.rod_side) / area_a;
    s[P_ACC] = c.working;
    s[P_PA] = c.working + c.preload * (s[P_A] - c.working);
    s[P_PB] = c.working + c.preload * (s[P_B] - c.working);
    s[V_GAS] = c.shell * pow((c.precharge + c.atmosphere) / (c.working + c.atmosphere), 1 / c.exponent);
    for (i = 0; i < 4; i++) s[AIR + i] = c.air_shift * fmin(fmax(s[P_A + i], 0) / c.transition, 1);
}

static void runge_kutta(double *s, double h)
{
    double k[4][STATES], at[STATES];
    static const double share[4] = { 0, 0.5, 0.5, 1 };
    int stage, i;
    for (stage = 0; stage < 4; stage++) {
        for (i = 0; i < STATES; i++) at[i] = s[i] + (stage ? share[stage] * h * k[stage - 1][i] : 0);
        derive(at, k[stage]);
    }
    for (i = 0; i < STATES; i++) s[i] += h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
}

/* --- sensors --- */
static uint64_t seed;

static double uniform(void) /* within (0, 1); xorshift64*, Vigna 2016 */
{
    seed ^= seed >> 12, seed ^= seed << 25, seed ^= seed >> 27;
    return ((double)((seed * UINT64_C(2685821657736338717)) >> 11) + 0.5) / 9007199254740992.0;
}

static double normal(void) /* Box and Muller 1958 */
{
    const double radius = sqrt(-2 * log(uniform()));
    return radius * cos(2 * PI * uniform());
}

static double stroke(const double *s)
{
    double by[SHAPES];
    return cylinder(s + U, by) - c.shortest;
}

static void sense(const double *s, double seen[READINGS])
{
    seen[0] = stroke(s);
    memcpy(seen + 1, s + P_A, 5 * sizeof *seen);
    seen[6] = s[MOTOR];
}

static double rounded(double value, double unit)
{
    return unit > 0 ? unit * floor(value / unit + 0.5) : value;
}

static void digitise(const double lagged[READINGS], double read[READINGS])
{
    const double unit = c.bits > 0 ? c.span / pow(2, c.bits) : 0;
    int i;
    read[0] = rounded(lagged[0] + c.position_noise * normal(), c.position_resolution);
    for (i = 1; i < 6; i++) {
        const double noisy = lagged[i] + c.pressure_noise * c.span * normal();
        read[i] = rounded(fmax(-c.atmosphere, fmin(c.span, noisy)), unit);
    }
    read[6] = lagged[6];
}

static void answer(const double read[READINGS], const double *s)
{
    int i;
    for (i = 0; i < READINGS; i++) printf("%.17g ", read[i]);
    printf("%.17g\n", stroke(s));
    fflush(stdout);
}

int main(int count, char **arguments)
{
    double s[STATES], seen[READINGS], lagged[READINGS], read[READINGS], sent[READINGS];
    double value, sent_speed = 0, lag;
    char line[128], request[16];
    int steps, k, i;
    if (count < 2) fail("usage", "crane FILE [section.key=VALUE ...]");
    read_crane(arguments[1], count - 2, arguments + 2);
    area_a = PI / 4 * c.piston * c.piston;
    area_b = area_a - PI / 4 * c.rod * c.rod;
    seed = (uint64_t)c.seed * 2 + 1;
    build_boom();
    start(s);
    steps = (int)ceil(c.period / c.step - 1e-9);
    c.step = c.period / steps;
    lag = 1 - exp(-c.bandwidth * c.step);
    sense(s, lagged);
    digitise(lagged, read);
    answer(read, s);
    while (fgets(line, sizeof line, stdin) != NULL) {
        if (sscanf(line, "%15s %lf", request, &value) != 2 || !isfinite(value)) fail("not a request", line);
        if (strcmp(request, "payload") == 0) {
            load(value);
        } else if (strcmp(request, "valve") == 0) {
            valve = value;
        } else if (strcmp(request, "impulse") == 0) {
            s[DU] += value;
        } else if (strcmp(request, "run") == 0) {
            /* the fieldbus: a command reaches the drive a cycle later, a reading the controller */
            const double command = fmax(-c.max_speed, fmin(c.max_speed, sent_speed));
            sent_speed = value;
            memcpy(sent, read, sizeof sent);
            for (k = 0; k < steps; k++) {
                const double most = c.slew * c.step;
                set_point += fmax(-most, fmin(most, command - set_point));
                runge_kutta(s, c.step);
                sense(s, seen);
                for (i = 0; i < READINGS; i++) lagged[i] += lag * (seen[i] - lagged[i]);
            }
            digitise(lagged, read);
            if (!isfinite(stroke(s))) fail("the motion diverged; shorten", "integrator.step_us");
            if (c.shell - s[V_GAS] < c.residual) fail("the accumulator is empty, which is not modelled", line);
            answer(sent, s);
        } else {
            fail("not a request", line);
        }
    }
    return 0;
}
