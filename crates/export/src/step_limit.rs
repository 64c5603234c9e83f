//! Largest step of an exported crane, whose code takes no substeps.

use crate::crane::SEGMENTS;
use crate::error::ExportError;
use hydroboom_description::{BuildError, Description};
use hydroboom_model::StepLimit;

/// Longest step \[s\] of the published scheme over the whole stroke, up to the piston velocity at the motor's largest
/// speed, as `hydroboom check` shows it. A crane file's own step must be stable; it may exceed the limit on chatter
/// of a tenth of a bar.
///
/// # Errors
///
/// [`ExportError::Step`] if the crane file's step is not stable.
pub(crate) fn longest_step(crane: &Description) -> Result<f64, ExportError> {
    let made = crane.crane::<SEGMENTS>()?;
    let own = crane.numbers.simulation_period;
    let mut longest = f64::INFINITY;
    for share in [0.0, 0.5, 1.0] {
        let start = crane.start(share * crane.numbers.stroke);
        let limit = made.step_limit(&made.at_rest(&start).map_err(BuildError::from)?);
        let bristle = StepLimit::of_bristles(&made.friction, crane.fastest_piston());
        let limit = StepLimit { bristle, ..limit };
        let (stable, bound) = limit.stable();
        if own > stable {
            return Err(ExportError::Step { step_us: own * 1e6, limit_us: stable * 1e6, bound });
        }
        longest = longest.min(limit.smallest());
    }
    Ok(longest.max(own))
}
