//! The step that an exported crane is moved on in: its code takes no substeps.

use crate::crane::SEGMENTS;
use crate::error::ExportError;
use hydroboom_description::{BuildError, Description};
use hydroboom_model::StepLimit;

/// The longest step \[s\] of the published scheme for a crane over its whole stroke, up to the piston velocity at the motor's largest speed, as
/// `hydroboom check` shows it; a crane file's own step may make the pressures chatter by more than the tenth of a bar that this limit allows, but
/// has to be stable.
///
/// # Errors
///
/// [`ExportError::Step`] where the crane file's own step is not.
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
