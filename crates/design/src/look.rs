//! Both loops at a piston position, before anything moves: the benchmark's and the scheduled LQR's.

use crate::linear::Mode;
use crate::scheduled_lqr::{designed, known_delay};
use crate::small_signal_controller::SmallSignalController;
use crate::{DesignError, Lifting, Loop, Margins, margins};
use hydroboom_description::Description;
use serde::Serialize;

/// A design at a piston position.
#[derive(Clone, Debug, Serialize)]
pub struct Look {
    /// Piston position.
    pub stroke_mm: f64,
    /// The mode in which boom and load ring on the oil.
    pub rings: Mode,
    /// Of the benchmark's loop.
    pub benchmark: Margins,
    /// Of the scheduled LQR's loop.
    pub scheduled_lqr: Margins,
}

/// The benchmark's loop around the machine. Drive and fieldbus, as the estimator knows them before anything is identified, delay it, and the sampling by half a
/// period.
pub fn benchmark_loop(description: &Description) -> Loop {
    let n = &description.numbers;
    let fieldbus = 2.0 * f64::from(known_delay(description)) * n.control_period;
    Loop::Benchmark {
        controller: description.benchmark(),
        high_pass: n.high_pass_time,
        delay: n.estimator_drive_lag + fieldbus + 0.5 * n.control_period,
    }
}

/// Pressure \[Pa\] that the piston side has beyond the load pressure, as the accumulator keeps the rod side.
const BEYOND: f64 = 1.5e5;

/// The scheduled LQR's loop around the machine at a piston position \[m\], settled at rest with the crane file's payload; the drive's lag is that of the crane file.
///
/// # Errors
///
/// As [`designed`].
pub fn scheduled_lqr_loop(description: &Description, stroke: f64) -> Result<Loop, DesignError> {
    let n = &description.numbers;
    let cycles = known_delay(description);
    let (mut estimator, law) = designed(description, cycles as usize)?;
    estimator.drive_share = n.control_period / n.estimator_drive_lag;
    let controller = SmallSignalController::at_rest(&estimator, &law, stroke, n.payload, BEYOND);
    Ok(Loop::ScheduledLqr {
        controller: Box::new(controller),
        delay: (2.0 * f64::from(cycles) + 0.5) * n.control_period,
        drive_lag: n.estimator_drive_lag,
        sensor_lag: estimator.filter.sensor_lag,
    })
}

/// The loop at a piston position \[m\] of a crane.
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be linearised there.
pub fn look(description: &Description, stroke: f64) -> Result<Look, DesignError> {
    let crane = Lifting::new(description, stroke)?;
    Ok(Look {
        stroke_mm: stroke * 1e3,
        rings: *crane.ringing()?,
        benchmark: margins(&crane, &benchmark_loop(description))?,
        scheduled_lqr: margins(&crane, &scheduled_lqr_loop(description, stroke)?)?,
    })
}
