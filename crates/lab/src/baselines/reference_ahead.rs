//! Reference over the horizon: state and motor speed of the smoothed, feasible reference by inverse
//! dynamics, as in the scheduled LQR.

use super::estimated_machine::Now;
use super::horizon::{BEGINS, BLOCKS, PERIODS};
use hydroboom_control::estimation::state_estimator::PredictedState;
use hydroboom_control::feedback::inverse_dynamics::inverse_dynamics;
use hydroboom_control::feedback::scheduled_lqr::ScheduledLqr;
use hydroboom_control::reference::preview::Preview;
use hydroboom_control::reference::smoothing::smoothed;
use hydroboom_control::reference::speed_limit::SpeedLimit;

/// Reference at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReferencePoint {
    /// Reference state of the reduced model.
    pub state: PredictedState<f64>,
    /// Reference position of the piston \[m\].
    pub piston: f64,
}

/// Reference at the beginning of every block and at the end of the horizon, with the motor speed \[rev/s\]
/// of every block.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReferenceHorizon {
    /// Reference at the beginnings of the blocks, and at the end.
    pub points: [ReferencePoint; BLOCKS + 1],
    /// Motor speed of the reference by inverse dynamics in each block \[rev/s\], advanced by the drive's lag.
    pub motor_speeds: [f64; BLOCKS],
}

/// State of the reference from period to period.
pub(super) struct ReferenceAhead {
    /// Smoothing window \[s\].
    window: f64,
    limit: SpeedLimit<f64>,
}

impl ReferenceAhead {
    /// Initial state at rest at a position \[m\].
    pub(super) fn at_rest(law: &ScheduledLqr<f64>, now: Now<'_>, position: f64) -> Self {
        let lag = now.estimated.drive.ramp_delay(law.period);
        Self { window: law.settings.shortest_window + lag, limit: SpeedLimit::at_rest(position) }
    }

    /// Reference from the time the command acts; advances the state by one control period.
    pub(super) fn horizon(
        &mut self,
        law: &ScheduledLqr<f64>,
        now: Now<'_>,
        preview: &Preview<f64>,
    ) -> ReferenceHorizon {
        let Now { estimator, estimated, predicted } = now;
        self.limit.update(preview, law.fastest(estimated, &predicted));
        self.window = law.next_window(self.window, estimator, estimated, preview);
        let (limit, window, period) = (&self.limit, self.window, law.period);
        let is_limited = limit.is_active();
        let feasible = |after: f64| limit.reference(preview, is_limited, after, period);
        let turning = preview.largest_acceleration() * window;
        let estimate = &estimated.filter.estimate;
        let at = |after: f64| {
            let reference = smoothed(feasible, window, after);
            let rod_side_term = estimated.rod_side_term;
            let state = inverse_dynamics(&law.model, estimate, &reference, turning, rod_side_term);
            ReferencePoint { state, piston: reference.position }
        };
        let delay = estimator.command_delay();
        let lag = estimated.drive.ramp_delay(period);
        let begin = |k: usize| delay + period * BEGINS[k] as f64;
        ReferenceHorizon {
            points: std::array::from_fn(|k| at(begin(k))),
            // taken at the middle of a longer block; that of a single-period block equals the scheduled
            // LQR's
            motor_speeds: std::array::from_fn(|k| {
                let middle = 0.5 * period * (PERIODS[k] - 1) as f64;
                at(begin(k) + lag + middle).state.motor_speed
            }),
        }
    }
}
