//! Controllers within the frame: what is exported to run without the supervisor.

use crate::feedback::benchmark::{Benchmark, BenchmarkInput, BenchmarkMemory};
use crate::reference::profile::SetPoint;
use crate::supervision::frame::{Directive, Frame, FrameInput, FrameOutput, FrameState};
use hydroboom_math::{Real, record};

/// Share of the proportional gain K_p that is left once the loop was found in sustained oscillation; the
/// integral is frozen then, at its mean.
const FALLBACK_SHARE: f64 = 0.3;
/// Time constant of that mean \[s\]: some periods of an oscillation.
const MEAN_TIME: f64 = 2.0;

record! {
    /// State of the benchmark controller within the frame.
    pub struct FramedMemory<T> {
        /// Integral part of u_FC, as a piston velocity
        #[unit = "m/s"]
        pub integral: T,
        /// Low-passed load pressure
        #[unit = "Pa"]
        pub low_passed: T,
        /// Mean of the integral part, its constant value during a sustained oscillation
        #[unit = "m/s"]
        pub mean_integral: T,
    }
}

/// Benchmark controller within the frame. Its state is a [`FramedBenchmarkState`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramedBenchmark<T> {
    /// Frame.
    pub frame: Frame<T>,
    /// Benchmark controller.
    pub benchmark: Benchmark<T>,
    /// Rod-side area over piston area, A_r/A_p \[1\].
    pub area_ratio: T,
}

/// State of the benchmark controller and of the frame around it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FramedBenchmarkState<T> {
    /// State of the frame.
    pub frame: FrameState<T>,
    /// State of the controller.
    pub controller: FramedMemory<T>,
}

impl<T: Real> FramedBenchmark<T> {
    /// One control period: next state and outputs.
    #[inline(always)]
    pub fn advance(
        &self,
        before: &FramedBenchmarkState<T>,
        input: &FrameInput<T>,
    ) -> (FramedBenchmarkState<T>, FrameOutput<T>) {
        let mut controller = before.controller;
        let always = T::zero().lt(T::one());
        let (frame, output) = self.frame.advance(&before.frame, input, always, |now| {
            let benchmark = gains(&self.benchmark, now.falls_back);
            let measured = measured(now, self.area_ratio);
            let feedforward = benchmark.velocity_feedforward(&now.reference);
            motor_speed(&benchmark, &mut controller, now, &measured, feedforward, now.begins)
        });
        (FramedBenchmarkState { frame, controller }, output)
    }
}

record! {
    /// Signals of the simulated crane.
    pub struct SimulatedCrane<T> {
        /// Piston position
        #[unit = "m"]
        pub stroke: T,
        /// Piston velocity
        #[unit = "m/s"]
        pub velocity: T,
        /// Load pressure
        #[unit = "Pa"]
        pub load_pressure: T,
    }
}

record! {
    /// Alignment of the simulated crane with the machine while the load is held.
    pub struct Alignment<T> {
        /// Reference position of the simulated crane
        #[unit = "m"]
        pub position: T,
        /// Reference velocity of the simulated crane
        #[unit = "m/s"]
        pub velocity: T,
        /// Motor speed of the simulated crane
        #[unit = "rev/s"]
        pub motor: T,
        /// 1 once the simulated crane deviates too much from the machine while the controller is active
        #[unit = "1"]
        pub is_lost: T,
    }
}

/// Benchmark controller with simulation feedforward within the frame (section 4, figure 15).
///
/// A benchmark controller on a simulated crane provides the motor speed that is the feedforward of the one on the
/// machine. While the load is held the simulated crane is led to the piston position, so that the controller can
/// start anywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramedSimulationFeedforward<T> {
    /// Frame.
    pub frame: Frame<T>,
    /// Benchmark controller, both for the machine and for the simulated crane.
    pub benchmark: Benchmark<T>,
    /// Rod-side area over piston area, A_r/A_p \[1\].
    pub area_ratio: T,
}

/// State of the simulation feedforward within the frame, without that of the simulated crane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FramedSimulationState<T> {
    /// State of the frame.
    pub frame: FrameState<T>,
    /// State of the machine's controller.
    pub controller: FramedMemory<T>,
    /// State of the simulated crane's controller.
    pub simulated: BenchmarkMemory<T>,
    /// Alignment of the simulated crane with the machine.
    pub alignment: Alignment<T>,
}

/// Rate at which the simulated crane is led to the machine \[1/s\], its largest speed \[m/s\] and
/// acceleration \[m/s²\]: the length of a stroke within the time of a release, without exciting it much.
const ALIGNMENT: (f64, f64, f64) = (2.0, 0.12, 0.3);
/// Distance \[m\] and velocity \[m/s\] within which it stands where the machine is.
const ALIGNED: (f64, f64) = (1e-3, 2e-3);

impl<T: Real> FramedSimulationFeedforward<T> {
    /// One control period, with the signals of the simulated crane: next state and outputs. The motor speed for the
    /// simulated crane until the next period is in the state.
    #[inline(always)]
    pub fn advance(
        &self,
        before: &FramedSimulationState<T>,
        input: &FrameInput<T>,
        crane: &SimulatedCrane<T>,
    ) -> (FramedSimulationState<T>, FrameOutput<T>) {
        let b = &self.benchmark;
        let within = |value: T, limit: f64| value.abs().lt(T::lit(limit));
        let held = before.frame.memory.stroke;
        let is_ready = within(crane.stroke - held, ALIGNED.0)
            & within(crane.velocity, ALIGNED.1)
            & within(before.alignment.velocity, ALIGNED.1);
        let mut controller = before.controller;
        let mut alignment = before.alignment;
        let shown = BenchmarkInput { stroke: crane.stroke, load_pressure: crane.load_pressure };
        let (fresh, kept) = (b.start(&shown), before.simulated);
        let has_begun = T::lit(0.5).lt(before.frame.memory.has_begun);
        let mut simulated = BenchmarkMemory {
            integral: T::select(has_begun, kept.integral, fresh.integral),
            low_passed: T::select(has_begun, kept.low_passed, fresh.low_passed),
        };
        let (frame, output) = self.frame.advance(&before.frame, input, is_ready, |now| {
            // the simulated crane follows the reference, or is led to where the piston is
            let led_to = aligned(&mut alignment, now, b.period);
            let reference = SetPoint {
                position: T::select(now.controls, now.reference.position, led_to.position),
                velocity: T::select(now.controls, now.reference.velocity, led_to.velocity),
            };
            let own = b.velocity_feedforward(&reference);
            let wanted = b.update(&mut simulated, &reference, &shown, own);
            // a gain that is no number is no reason to lose the simulated crane
            let is_finite = wanted.is_finite() & simulated.integral.is_finite();
            let wanted = T::select(is_finite, wanted, T::zero());
            simulated.integral = T::select(is_finite, simulated.integral, T::zero());
            simulated.low_passed = T::select(is_finite, simulated.low_passed, shown.load_pressure);
            alignment.motor = b.limits.follow(alignment.motor, wanted, b.period);

            // a simulated crane that is somewhere else leads nowhere
            let near = (crane.stroke - now.stroke).abs().lt(self.frame.limits.tracking);
            let was_lost = T::lit(0.5).lt(before.alignment.is_lost) & !now.begins;
            let is_lost = now.controls & (was_lost | !near | !alignment.motor.is_finite());
            alignment.is_lost = T::select(is_lost, T::one(), T::zero());
            let benchmark = gains(b, now.falls_back);
            let measured = measured(now, self.area_ratio);
            let velocity = benchmark.velocity_feedforward(&now.reference);
            let feedforward = T::select(is_lost | now.falls_back, velocity, alignment.motor);
            let takes_over = now.begins | (is_lost & !was_lost);
            motor_speed(&benchmark, &mut controller, now, &measured, feedforward, takes_over)
        });
        (FramedSimulationState { frame, controller, simulated, alignment }, output)
    }
}

/// Where the simulated crane is led to: to the piston while the load is held, with it while the controller
/// has the load.
fn aligned<T: Real>(alignment: &mut Alignment<T>, now: &Directive<T>, period: T) -> SetPoint<T> {
    let (rate, speed, acceleration) = ALIGNMENT;
    let wanted = T::lit(rate) * (now.stroke - alignment.position);
    let wanted = wanted.clamp(T::lit(-speed), T::lit(speed));
    let reach = T::lit(acceleration) * period;
    let velocity = wanted.clamp(alignment.velocity - reach, alignment.velocity + reach);
    let position = alignment.position + velocity * period;
    alignment.position = T::select(now.controls, now.reference.position, position);
    alignment.velocity = T::select(now.controls, T::zero(), velocity);
    SetPoint { position, velocity }
}

/// Gains of the benchmark: as they are, or those that it falls back to.
fn gains<T: Real>(benchmark: &Benchmark<T>, falls_back: T::Mask) -> Benchmark<T> {
    let weaker = T::lit(FALLBACK_SHARE) * benchmark.proportional;
    Benchmark {
        proportional: T::select(falls_back, weaker, benchmark.proportional),
        integral: T::select(falls_back, T::zero(), benchmark.integral),
        ..*benchmark
    }
}

fn measured<T: Real>(now: &Directive<T>, area_ratio: T) -> BenchmarkInput<T> {
    BenchmarkInput {
        stroke: now.stroke,
        load_pressure: now.pressure_a - area_ratio * now.pressure_b,
    }
}

/// Motor speed \[rev/s\] of the benchmark; where it takes over, the one commanded until now.
fn motor_speed<T: Real>(
    benchmark: &Benchmark<T>,
    memory: &mut FramedMemory<T>,
    now: &Directive<T>,
    measured: &BenchmarkInput<T>,
    feedforward: T,
    takes_over: T::Mask,
) -> T {
    let was = *memory;
    let low_passed = T::select(now.begins, measured.load_pressure, was.low_passed);
    let mut begun = BenchmarkMemory { integral: T::zero(), low_passed };
    benchmark.take_over(&mut begun, &now.reference, measured, feedforward, now.motor_speed);
    let integral = T::select(now.falls_back, was.mean_integral, was.integral);
    let integral = T::select(takes_over, begun.integral, integral);
    let mut next = BenchmarkMemory { integral, low_passed };
    let speed = benchmark.update(&mut next, &now.reference, measured, feedforward);
    // while the load is held nothing is remembered
    memory.integral = T::select(now.controls, next.integral, T::zero());
    memory.low_passed = T::select(now.controls, next.low_passed, measured.load_pressure);
    let share = benchmark.period / T::lit(MEAN_TIME);
    let mean = was.mean_integral + share * (next.integral - was.mean_integral);
    let mean = T::select(now.falls_back, was.mean_integral, mean);
    let mean = T::select(now.begins, begun.integral, mean);
    memory.mean_integral = T::select(now.controls, mean, T::zero());
    speed
}
