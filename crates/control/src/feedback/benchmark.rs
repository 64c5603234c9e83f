//! The benchmark controller (section 2.3.1, figure 5): velocity feedforward, PI, pressure
//! feedback.
//!
//! The same controller acting on the *simulated* crane gives the simulation-based feedforward of section 4.
//! Its speed is sent to the real crane: alone in open loop (figure 13), or in place of the velocity
//! feedforward in closed loop (figure 15).

use crate::actuator_limits::ActuatorLimits;
use crate::controller::AxisState;
use crate::feedback::filter::HighPass;
use crate::measurement::AxisSignals;
use crate::reference::profile::SetPoint;
use hydroboom_math::{Real, record};

record! {
    /// Inputs of the benchmark controller, of the measured or the simulated crane.
    pub struct BenchmarkInput<T> {
        /// Piston position, x_cyl
        #[unit = "m"]
        pub stroke: T,
        /// Load pressure, p_L = p_A − (A_r/A_p) p_B
        #[unit = "Pa"]
        pub load_pressure: T,
    }
}

impl<T: Real> BenchmarkInput<T> {
    /// Inputs from the signals of an axis. `area_ratio` is A_r/A_p \[1\].
    #[inline(always)]
    pub fn of(signals: &AxisSignals<T>, area_ratio: T) -> Self {
        Self { stroke: signals.stroke, load_pressure: signals.load_pressure(area_ratio) }
    }

    /// Inputs from the state of a simulated axis.
    #[inline(always)]
    pub fn of_simulated(state: &AxisState<T>) -> Self {
        Self { stroke: state.stroke, load_pressure: state.load_pressure }
    }
}

record! {
    /// State of the benchmark controller.
    pub struct BenchmarkMemory<T> {
        /// Integral part of u_FC, as a piston velocity
        #[unit = "m/s"]
        pub integral: T,
        /// Low-passed load pressure
        #[unit = "Pa"]
        pub low_passed: T,
    }
}

/// Benchmark controller: PI position control with pressure feedback (1) to (3). Its state is a [`BenchmarkMemory`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Benchmark<T> {
    /// Proportional gain K_p \[1/s\]: piston velocity per position error.
    pub proportional: T,
    /// Integral gain K_i \[1/s²\].
    pub integral: T,
    /// Pressure feedback k_f \[m³/(s·Pa)\]: flow per load pressure.
    pub pressure_feedback: T,
    /// High-pass of the pressure feedback, τ s/(τ s + 1).
    pub high_pass: HighPass<T>,
    /// Pump revolutions per metre of piston travel, A_p/K_VP \[rev/m\].
    pub revolutions_per_metre: T,
    /// Pump displacement K_VP \[m³/rev\].
    pub displacement: T,
    /// Limits of the motor's speed, for anti-windup.
    pub limits: ActuatorLimits<T>,
    /// Sample period \[s\].
    pub period: T,
}

impl<T: Real> Benchmark<T> {
    /// Initial state without a bump: integral zero, low-pass at the measured load pressure \[Pa\].
    pub fn start(&self, measured: &BenchmarkInput<T>) -> BenchmarkMemory<T> {
        BenchmarkMemory { integral: T::zero(), low_passed: measured.load_pressure }
    }

    /// Velocity feedforward u_FF = A_p/K_VP v_ref \[rev/s\] (1).
    #[inline(always)]
    pub fn velocity_feedforward(&self, reference: &SetPoint<T>) -> T {
        self.revolutions_per_metre * reference.velocity
    }

    /// Motor speed n_ref = u_FF + u_FC − u_PF \[rev/s\] with the given feedforward \[rev/s\].
    ///
    /// `u_FC = e (K_p + K_i/s)` (2) with the integral by zero-order hold; `u_PF = k_f/k_q ·
    /// τ s/(τ s + 1) p_L` (3). The integral holds while the speed is limited and the error would
    /// drive it further.
    #[inline(always)]
    pub fn update(
        &self,
        memory: &mut BenchmarkMemory<T>,
        reference: &SetPoint<T>,
        measured: &BenchmarkInput<T>,
        feedforward: T,
    ) -> T {
        let error = reference.position - measured.stroke;
        let u_fc = self.revolutions_per_metre * (self.proportional * error + memory.integral);
        let filtered = self.high_pass.update(&mut memory.low_passed, measured.load_pressure);
        let u_pf = self.pressure_feedback / self.displacement * filtered;
        let wanted = feedforward + u_fc - u_pf;

        let zero = T::zero();
        let winding_up = self.limits.speed.lt(wanted) & zero.lt(error);
        let winding_down = wanted.lt(-self.limits.speed) & error.lt(zero);
        let gained = memory.integral + self.integral * self.period * error;
        memory.integral = T::select(winding_up | winding_down, memory.integral, gained);

        wanted.clamp(-self.limits.speed, self.limits.speed)
    }

    /// Sets the integral so that the next [`update`](Self::update) with these inputs returns `speed` \[rev/s\]:
    /// bumpless transfer from another controller.
    #[inline(always)]
    pub fn take_over(
        &self,
        memory: &mut BenchmarkMemory<T>,
        reference: &SetPoint<T>,
        measured: &BenchmarkInput<T>,
        feedforward: T,
        speed: T,
    ) {
        let mut ahead = *memory;
        let error = reference.position - measured.stroke;
        let filtered = self.high_pass.update(&mut ahead.low_passed, measured.load_pressure);
        let u_pf = self.pressure_feedback / self.displacement * filtered;
        let lacking = speed - feedforward + u_pf;
        memory.integral = lacking / self.revolutions_per_metre - self.proportional * error;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_math::Lanes;

    fn benchmark<T: Real>() -> Benchmark<T> {
        let lit = T::lit;
        Benchmark {
            proportional: lit(4.5),
            integral: lit(14.45),
            pressure_feedback: lit(4.77e-11),
            high_pass: HighPass::new(lit(1.04), lit(1e-3)),
            revolutions_per_metre: lit(313.05),
            displacement: lit(10.6e-6),
            limits: ActuatorLimits { speed: lit(50.0), slew: lit(500.0) },
            period: lit(1e-3),
        }
    }

    #[test]
    fn bumpless_transfer_starts_at_the_present_motor_speed() {
        let controller = benchmark::<f64>();
        let reference = SetPoint { position: 0.21, velocity: 0.05 };
        let measured = BenchmarkInput { stroke: 0.2, load_pressure: 71e5 };
        let mut memory = BenchmarkMemory { integral: 0.3, low_passed: 68e5 };
        let feedforward = controller.velocity_feedforward(&reference);
        controller.take_over(&mut memory, &reference, &measured, feedforward, 12.5);
        let next = controller.update(&mut memory, &reference, &measured, feedforward);
        assert!((next - 12.5).abs() < 1e-9, "{next}");
    }

    const STILL: SetPoint<f64> = SetPoint { position: 0.2, velocity: 0.0 };

    #[test]
    fn constant_load_pressure_gives_no_pressure_feedback() {
        let (controller, measured) =
            (benchmark(), BenchmarkInput { stroke: 0.2, load_pressure: 68e5 });
        let mut memory = controller.start(&measured);
        assert_eq!(controller.update(&mut memory, &STILL, &measured, 0.0), 0.0);
        // 1 bar more, at once: k_f/K_VP per Pascal, against the motion that raised it
        let risen = BenchmarkInput { load_pressure: 69e5, ..measured };
        let speed = controller.update(&mut memory, &STILL, &risen, 0.0);
        assert!((speed + 4.77e-11 / 10.6e-6 * 1e5).abs() < 1e-12, "{speed}");
    }

    #[test]
    fn the_integral_does_not_wind_up_at_the_motor_limit() {
        let controller = benchmark();
        let far = BenchmarkInput { stroke: -0.3, load_pressure: 0.0 };
        let mut memory = controller.start(&far);
        for _ in 0..5000 {
            assert_eq!(controller.update(&mut memory, &STILL, &far, 0.0), 50.0);
        }
        let past = BenchmarkInput { stroke: 0.21, load_pressure: 0.0 };
        assert!(controller.update(&mut memory, &STILL, &past, 0.0) < 0.0);
    }

    #[test]
    fn controller_in_lanes_equals_the_one_in_f64() {
        let errors = [-0.4, -1e-3, 1e-5, 0.3];
        let controller = benchmark();
        let lanes = benchmark::<Lanes<4>>();
        let measured = BenchmarkInput { stroke: Lanes(errors), load_pressure: Lanes([60e5; 4]) };
        let mut lane_memory = lanes.start(&measured.map(|v| v * Lanes([0.9; 4])));
        let reference = STILL.map(|v| Lanes([v; 4]));
        let speeds = lanes.update(&mut lane_memory, &reference, &measured, Lanes([0.1; 4]));
        for (lane, stroke) in errors.into_iter().enumerate() {
            let measured = BenchmarkInput { stroke, load_pressure: 60e5 };
            let mut memory = controller.start(&measured.map(|v| v * 0.9));
            let speed = controller.update(&mut memory, &STILL, &measured, 0.1);
            assert_eq!(speeds.0[lane], speed);
            assert_eq!(lane_memory.integral.0[lane], memory.integral);
        }
    }
}
