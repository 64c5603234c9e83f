//! Payload that the identification of a machine found.

use hydroboom_description::Description;
use hydroboom_identify::Tuned;
use serde::Serialize;

/// Key of the payload.
const PAYLOAD: &str = "payload.mass_kg";

/// Payload found by identification.
///
/// Pressures show a load's moment about the boom's bearing, and hardly its lever. The mass is that of a load with this
/// moment at the model's lever: a load at another lever has another mass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IdentifiedPayload {
    /// Mass of the payload \[kg\] at the lever of the model.
    pub mass_kg: f64,
    /// Lever of the model \[mm\]: distance of the load's centre of mass from the bearing, along the boom
    /// (`payload.x_mm`).
    pub lever_mm: f64,
    /// 95 % interval of the mass \[kg\]; none if it is not finite.
    pub interval_95_kg: Option<[f64; 2]>,
}

impl IdentifiedPayload {
    /// Payload of a fit to a model; none if its mass was not free.
    pub(crate) fn of(tuned: &[Tuned], model: &Description) -> Option<Self> {
        let found = tuned.iter().find(|tuned| tuned.key.path() == PAYLOAD)?;
        let (low, high) = found.interval();
        let is_finite = low.is_finite() && high.is_finite();
        Some(Self {
            mass_kg: found.value.1,
            lever_mm: 1e3 * model.numbers.payload_x,
            interval_95_kg: is_finite.then_some([low, high]),
        })
    }
}
