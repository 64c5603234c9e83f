//! Observability of the estimator's states in the phases of a cycle.
//!
//! Over a phase of a motion the reduced model is linearised along its own path. With the states in units of their
//! initial standard deviations and the measurements in units of their noise, the observability Gramian is
//!
//! ```text
//! W = Σ (H_k Φ_k)ᵀ (H_k Φ_k),    Φ_{k+1} = F_k Φ_k,  Φ_0 = 1
//! ```
//!
//! A state whose standard deviation the phase alone brings down by a factor q has `((1 + W)⁻¹)_ii = 1/q²`; q = 1 says
//! that the motion does not excite it.
//!
//! Source: A. Krener, K. Ide, *Measures of unobservability*, 2009.

use crate::operating_points::rod_side_term;
use crate::scheduled_lqr::designed;
use crate::{DesignError, scheduled_lqr::known_delay};
use hydroboom_control::estimation::reduced_model::{MachineState, STATES};
use hydroboom_control::feedback::inverse_dynamics::inverse_dynamics;
use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::reference::smoothing::smoothed;
use hydroboom_description::Description;
use nalgebra::SMatrix;
use serde::Serialize;

/// Smoothing window of the reference \[s\].
const WINDOW: f64 = 0.1;

/// Observability of the estimator's states in a phase of a motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Phase {
    /// Name of the phase.
    pub name: &'static str,
    /// Start of the phase in the motion \[s\].
    pub begin_s: f64,
    /// End of the phase in the motion \[s\].
    pub end_s: f64,
    /// Ratio of each state's standard deviation before and after the measurements of this phase alone \[1\], in the
    /// order of [`MachineState::NAMES`].
    pub reduction: [f64; STATES],
    /// Singular values of the scaled observability Gramian, the largest first.
    pub singular_values: [f64; STATES],
}

type Square = SMatrix<f64, STATES, STATES>;

/// Observability in the phases of the crane file's out-and-back motion at a speed \[m/s\], positive: seven phases,
/// then the whole motion.
///
/// # Errors
///
/// As [`designed`].
pub fn observability(description: &Description, speed: f64) -> Result<Vec<Phase>, DesignError> {
    let motion = description.motion(speed);
    let travel = motion.travel_time();
    let out = motion.rest;
    let back = out + travel + motion.dwell;
    [
        ("at rest", out - 1.0, out - WINDOW),
        ("accelerating outwards", out - WINDOW, out + motion.ramp),
        ("at constant speed outwards", out + motion.ramp, out + travel - motion.ramp),
        ("braking outwards", out + travel - motion.ramp, out + travel + WINDOW),
        ("at rest, after the motion", out + travel + WINDOW, out + travel + 1.0),
        ("accelerating inwards", back - WINDOW, back + motion.ramp),
        ("at constant speed inwards", back + motion.ramp, back + travel - motion.ramp),
        ("the whole motion", 0.0, motion.duration()),
    ]
    .into_iter()
    .map(|(name, begin, end)| phase(description, &motion, name, begin.max(0.0), end))
    .collect()
}

fn phase(
    description: &Description,
    motion: &OutAndBack<f64>,
    name: &'static str,
    begin_s: f64,
    end_s: f64,
) -> Result<Phase, DesignError> {
    let (estimator, _) = designed(description, known_delay(description) as usize)?;
    let filter = &estimator.filter;
    let model = &filter.model;
    let n = &description.numbers;
    let period = n.control_period;
    let rod_side = rod_side_term(description);
    let parameters = MachineState {
        payload: n.payload,
        transition_pressure: n.transition,
        friction: 0.0,
        disturbance: 0.0,
        unknown_flow: 0.0,
        position: 0.0,
        velocity: 0.0,
        load_pressure: 0.0,
    };
    let wanted = |time: f64| {
        let reference = smoothed(|after| motion.reference(time + after), WINDOW, 0.0);
        inverse_dynamics(model, &parameters, &reference, 0.0, rod_side)
    };
    let first = wanted(begin_s);
    let velocity = motion.reference(begin_s).velocity;
    let sliding = if velocity == 0.0 { 0.0 } else { velocity.signum() };
    let mut z = MachineState {
        position: first.position,
        velocity: first.velocity,
        load_pressure: first.load_pressure,
        friction: sliding * model.coulomb,
        ..parameters
    };
    let scale = Square::from_diagonal(&filter.initial_deviation.to_array().into());
    let mut to_now = scale;
    let mut gramian = Square::zeros();
    for k in 0..((end_s - begin_s) / period) as usize {
        let time = begin_s + (k as f64 + 0.5) * period;
        let (next, jacobian) = filter.transition(&z, wanted(time).motor_speed, rod_side);
        z = next;
        let jacobian = Square::from_fn(|i, j| jacobian[i][j]);
        to_now = jacobian * to_now;
        let at = model.at(z.position, z.payload);
        for (row, noise) in filter.measurement_rows(&at).iter().zip(filter.measurement_noise) {
            let seen =
                (to_now.row(0) * row[0] + to_now.row(1) * row[1] + to_now.row(2) * row[2]) / noise;
            gramian += seen.transpose() * seen;
        }
    }
    let posterior = (Square::identity() + gramian).try_inverse().unwrap_or_else(Square::identity);
    let values = gramian.singular_values();
    let mut singular_values: [f64; STATES] = std::array::from_fn(|i| values[i]);
    singular_values.sort_by(|a, b| b.total_cmp(a));
    Ok(Phase {
        name,
        begin_s,
        end_s,
        reduction: std::array::from_fn(|i| 1.0 / posterior[(i, i)].max(f64::MIN_POSITIVE).sqrt()),
        singular_values,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The transition pressure of the oil is observable while the pressure changes, and hardly at rest.
    /// Position and pressure are measured, and observable everywhere.
    #[test]
    fn the_oil_is_observable_in_motion_only() {
        let description = Description::uia_single_boom().unwrap();
        let phases = observability(&description, description.numbers.fast).unwrap();
        let named = |name: &str| phases.iter().find(|phase| phase.name == name).unwrap();
        let oil =
            MachineState::NAMES.iter().position(|name| *name == "transition_pressure").unwrap();
        let (rest, all) = (named("at rest"), named("the whole motion"));
        assert!(rest.reduction[oil] < 1.05, "{rest:?}");
        assert!(all.reduction[oil] > rest.reduction[oil], "{all:?}");
        for phase in &phases {
            assert!(phase.reduction[2] > 3.0, "{phase:?}");
        }
    }
}
