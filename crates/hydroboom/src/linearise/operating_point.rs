//! Operating point of a linearisation: motion before it, its steadiness, and the dead band of the load-holding valve.

use hydroboom_description::Description;
use hydroboom_lab::{Plant, linearise, plant};
use hydroboom_model::{Input, Outputs, Scheme};
use miette::{IntoDiagnostic, Result};

/// Duration over which the pressure is watched, at the end of the motion before the operating point \[steps
/// of 1 ms\]: a period of a load at 2 Hz.
const WATCHED: u32 = 500;
/// Interval of that \[steps\].
const INTERVAL: u32 = 10;
/// Largest change of the pressure p_A in a steady motion, as a share of it \[-\].
const STEADY: f64 = 0.02;
/// Duration of the motion that leaves the dead band \[steps of 1 ms\].
const SETTLING: u32 = 1000;

/// Operating point at the end of a motion.
pub struct OperatingPoint {
    /// Outputs of the crane.
    pub outputs: Outputs<f64>,
    /// Change of p_A within the last half second of the motion \[Pa\].
    pub pressure_change: f64,
}

impl OperatingPoint {
    /// Piston position \[mm\].
    pub fn stroke_mm(&self) -> f64 {
        self.outputs.stroke * 1e3
    }

    /// Remark on a motion that is not steady; none if p_A changes by less than 2 %.
    pub fn remark_on_oscillation(&self) -> Option<String> {
        (self.pressure_change > STEADY * self.outputs.pressure_a).then(|| {
            format!(
                "The motion is not steady: p_A changes by {:.1} bar within the last half second. The matrices are of one instant of that oscillation, with the \
                 oil's stiffness at {:.1} bar; their damping is not that of a steady motion. --settle-s takes another instant.",
                self.pressure_change * 1e-5,
                self.outputs.pressure_a * 1e-5
            )
        })
    }
}

/// Moves the crane for so many steps of 1 ms.
///
/// # Errors
///
/// If the state leaves the model's range of validity.
pub fn settle(crane: &mut dyn Plant, input: &Input<f64>, steps: u32) -> Result<OperatingPoint> {
    let watched = steps.min(WATCHED) / INTERVAL;
    crane.advance(input, steps - watched * INTERVAL).into_diagnostic()?;
    let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
    for _ in 0..watched {
        crane.advance(input, INTERVAL).into_diagnostic()?;
        let pressure = crane.outputs().pressure_a;
        (lowest, highest) = (lowest.min(pressure), highest.max(pressure));
    }
    let pressure_change = (highest - lowest).max(0.0);
    Ok(OperatingPoint { outputs: crane.outputs(), pressure_change })
}

/// A motor speed \[rev/s\] that leaves the dead band within a second from rest at a piston position \[m\]; none if no
/// tested one does. `valve` is the state of the 3/2 valve.
pub fn motor_speed_outside_dead_band(
    description: &Description,
    stroke: f64,
    valve: f64,
) -> Option<f64> {
    let n = &description.numbers;
    let slow = n.slow * description.cylinder().piston_area / (n.displacement * n.flow_gain);
    let speeds = [slow, 2.0 * slow, 4.0 * slow, 0.5 * n.motor_speed, n.motor_speed];
    let is_outside = |speed: f64| {
        let start = description.start(stroke);
        let mut crane = plant(description, &start, Scheme::Implicit, 1e-3).ok()?;
        let input = Input { pump_speed: speed, holding_valve: valve };
        crane.advance(&input, SETTLING).ok()?;
        let (a, _) = crane.jacobian(&input);
        Some(!linearise::in_dead_band(&a, &crane.state_names()))
    };
    let mut reachable = speeds.into_iter().filter(|speed| *speed <= n.motor_speed);
    reachable.find(|speed| is_outside(*speed) == Some(true))
}
