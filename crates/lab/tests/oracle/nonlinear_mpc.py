#!/usr/bin/env python3
"""Optimal control problems of the nonlinear predictive controller, solved by IPOPT with CasADi's derivatives: an oracle for its tests.

    python3 -m venv venv && venv/bin/pip install casadi==3.8.2
    venv/bin/python crates/lab/tests/oracle/nonlinear_mpc.py

reads nonlinear_mpc_problems.json beside this script and writes nonlinear_mpc_solutions.json. Nothing of the Rust code is called: the reduced model
(crates/control/src/estimation/reduced_model.rs) and the problem (crates/lab/src/baselines/optimal_control_problem.rs) are written here from their equations, and states are
unknowns (multiple shooting), where the controller simulates them. Limits of the pressure are hard here.
"""

import json
import math
from pathlib import Path

import casadi as ca

HERE = Path(__file__).parent
LONGEST_STEP = 5
COEFFICIENTS = 6


class Model:
    """The reduced model, from its numbers in the order of the Rust record."""

    def __init__(self, numbers):
        numbers = iter(numbers)
        one = lambda: next(numbers)
        polynomial = lambda: [one() for _ in range(COEFFICIENTS)]
        self.half_stroke = one()
        self.holding = [polynomial() for _ in range(2)]
        self.mass = [polynomial() for _ in range(2)]
        self.give = [polynomial() for _ in range(3)]
        self.viscous, self.coulomb, self.presliding, _sliding_velocity = one(), one(), one(), one()
        self.beta_max, self.beta_min, _transition, self.transition_slope, _vapour = one(), one(), one(), one(), one()
        self.volume, self.area, self.displacement, self.leakage = one(), one(), one(), one()
        _disturbance_time, _maximum_payload = one(), one()
        assert next(numbers, None) is None, "the model has other numbers than this script knows"

    def at(self, y, m):
        """p_0, its slope along the stroke, a_p, gamma and volume."""
        xi = ca.fmin(ca.fmax((y - self.half_stroke) / self.half_stroke, -1), 1)
        value = lambda c: sum(a * xi**k for k, a in enumerate(c))
        slope = lambda c: sum(k * a * xi ** (k - 1) for k, a in enumerate(c) if k)
        p_0 = value(self.holding[0]) + m * value(self.holding[1])
        p_0_slope = (slope(self.holding[0]) + m * slope(self.holding[1])) / self.half_stroke
        a_p = 1 / (value(self.mass[0]) + m * value(self.mass[1]))
        gamma = (value(self.give[0]) + m * value(self.give[1]) + m * m * value(self.give[2])) * a_p**2
        return p_0, p_0_slope, a_p, gamma, self.volume + self.area * y

    def step(self, state, n_mean, disturbances, p_h, h):
        """Velocity implicit in its damping, then position, pressure and friction by the new velocity."""
        y, w, p, f = state
        d, r, m, transition = disturbances
        p_0, p_0_slope, a_p, gamma, volume = self.at(y, m)
        force = p - p_0 - p_0_slope * gamma * p - f + d
        w = (w + h * a_p * force) / (1 + h * a_p * self.viscous)
        beta = (self.beta_max + self.beta_min) / 2 + (self.beta_max - self.beta_min) / 2 * ca.tanh(
            (p + p_h - transition) * self.transition_slope)
        leak = self.leakage * ca.sqrt(ca.fmax(p, 1e4))
        inflow = self.displacement * (n_mean - leak + r) - self.area * w
        bending = self.presliding * h * w
        return [
            y + h * w,
            w,
            p + h * beta / (volume + gamma * self.area * beta) * inflow,
            (f + bending) / (1 + ca.fabs(bending) / self.coulomb),
        ]


def solve(problem):
    model = Model(problem["model"])
    y, w, p, f, d, r, m, transition = problem["begin"]
    begin, disturbances = [y, w, p, f, problem["motor_speed"]], (d, r, m, transition)
    periods, period, drive = problem["periods"], problem["period"], problem["drive"]
    points, speeds = problem["points"], problem["motor_speeds"]
    by_position, by_velocity, by_speed = problem["weights"]
    p_h, largest, slew = problem["rod_side_term"], problem["largest_speed"], problem["slew"]
    count = len(periods)
    # unknowns are of size one: metres per 0.01, metres a second per 0.1, 10 bar, 1 bar, 10 rev/s
    size = [0.01, 0.1, 1e6, 1e5, 10.0]
    states = [ca.SX.sym(f"z{k}", 5) for k in range(count)]
    commands = [ca.SX.sym(f"u{k}") for k in range(count)]
    state = [ca.SX(v) for v in begin]
    cost, constraints, low, high, pressures = 0, [], [], [], []
    for k in range(count):
        u = commands[k] * largest
        cost += 0.5 * periods[k] * by_speed * (u - speeds[k]) ** 2
        constraints.append(drive * (u - state[4]) / slew)
        low.append(-1)
        high.append(1)
        steps = math.ceil(periods[k] / LONGEST_STEP)
        length = periods[k] / steps
        rate = -math.log(1 - drive)
        share = 1 - math.exp(-rate * length)
        motion, n = state[:4], state[4]
        for _ in range(steps):
            left = n - u
            motion = model.step(motion, u + left * share / (rate * length), disturbances, p_h, period * length)
            n = n - left * share
        state = [states[k][i] * size[i] for i in range(5)]
        for i, (unknown, reached) in enumerate(zip(state, [*motion, n])):
            constraints.append((unknown - reached) / size[i])
            low.append(0)
            high.append(0)
        lowest, most = problem["pressure"]
        constraints.append((state[2] + p_h) / 1e6)
        low.append(lowest / 1e6)
        high.append(most / 1e6)
        pressures.append(state[2] + p_h)
        y_r, w_r, p_r, n_r, x_r = points[k + 1]
        # a block of m periods weighs its beginning (m + 1)/2 and its end (m - 1)/2
        weight = 0.25 * (periods[k] - 1 + (periods[k + 1] + 1 if k + 1 < count else 0))
        gamma = model.at(state[0], m)[3]
        cost += weight * by_position * (state[0] + gamma * state[2] - x_r) ** 2
        cost += weight * by_velocity * (state[1] - w_r) ** 2
    error = ca.vertcat(state[0] - y_r, state[1] - w_r, state[2] - p_r, state[4] - n_r)
    cost += 0.5 * error.T @ ca.DM(problem["cost_to_go"]) @ error
    unknowns = ca.vertcat(*states, *commands)
    guess = [points[k + 1][i] / size[j] if i is not None else 0.0
             for k in range(count) for j, i in enumerate([0, 1, 2, None, 3])]
    guess += [speed / largest for speed in speeds]
    free = [math.inf] * (5 * count)
    options = {"ipopt": {"tol": 1e-9, "acceptable_tol": 1e-9, "max_iter": 2000, "print_level": 0}, "print_time": False}
    solver = ca.nlpsol("solver", "ipopt", {"x": unknowns, "f": cost, "g": ca.vertcat(*constraints)}, options)
    found = solver(x0=guess, lbg=low, ubg=high, lbx=[-v for v in free] + [-1] * count, ubx=free + [1] * count)
    assert solver.stats()["success"], solver.stats()["return_status"]
    value = ca.Function("value", [unknowns], [ca.vertcat(*pressures)])(found["x"])
    return {
        "commands": [float(v) * largest for v in ca.vertsplit(found["x"][5 * count:])],
        "pressures": [float(v) for v in ca.vertsplit(value)],
        "cost": float(found["f"]),
    }


def main():
    problems = json.loads((HERE / "nonlinear_mpc_problems.json").read_text())
    solutions = {problem["name"]: solve(problem) for problem in problems}
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(solution)}" for name, solution in solutions.items())
    (HERE / "nonlinear_mpc_solutions.json").write_text("{\n" + lines + "\n}\n")


if __name__ == "__main__":
    main()
