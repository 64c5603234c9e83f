//! The benchmark's loop at a piston position, before anything moves.

use crate::linear::Mode;
use crate::scheduled_lqr::known_delay;
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
}

/// The benchmark's loop around the machine. Drive and fieldbus, as the estimator knows them before anything is identified, delay it, and the sampling by half a
/// period.
pub fn benchmark_loop(description: &Description) -> Loop {
    let n = &description.numbers;
    let fieldbus = 2.0 * f64::from(known_delay(description)) * n.control_period;
    Loop {
        controller: description.benchmark(),
        high_pass: n.high_pass_time,
        delay: n.estimator_drive_lag + fieldbus + 0.5 * n.control_period,
    }
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
    })
}
