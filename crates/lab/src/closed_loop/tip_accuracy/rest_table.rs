//! Height of the tip of the crane file's model at rest.

use crate::{LabError, plant};
use hydroboom_control::estimation::tip::TipLoad;
use hydroboom_description::Description;
use hydroboom_math::Real;
use hydroboom_model::Scheme;

/// Number of piston positions in the table of the published model.
const TABLE: usize = 17;

/// Height of the model's tip at rest over stroke and payload: linear in the payload, interpolated over the
/// stroke.
pub(super) struct RestTable {
    stroke: f64,
    empty: Vec<f64>,
    per_kg: Vec<f64>,
}

impl RestTable {
    pub(super) fn new(model: &Description) -> Result<Self, LabError> {
        let n = &model.numbers;
        let heavy = n.payload.max(1.0);
        let (mut empty, mut per_kg) = (Vec::new(), Vec::new());
        for k in 0..TABLE {
            let stroke = n.stroke * k as f64 / (TABLE - 1) as f64;
            let height = |payload: f64| {
                let mut loaded = model.clone();
                loaded.numbers.payload = payload;
                plant(&loaded, &loaded.start(stroke), Scheme::Implicit, 1e-3)
                    .map(|crane| crane.outputs().tip_y)
            };
            let without = height(0.0)?;
            empty.push(without);
            per_kg.push((height(heavy)? - without) / heavy);
        }
        Ok(Self { stroke: n.stroke, empty, per_kg })
    }

    /// Height \[m\].
    pub(super) fn at(&self, load: &TipLoad<f64>) -> f64 {
        let place = load.piston / self.stroke * (TABLE - 1) as f64;
        f64::interpolate(&self.empty, place) + load.payload * f64::interpolate(&self.per_kg, place)
    }
}
