//! Stability margins of the benchmark's loop around a family of virtual cranes.

use crate::LabError;
use crate::closed_loop::monte_carlo::{Spread, member};
use hydroboom_description::Description;
use hydroboom_design::{Lifting, Margins, benchmark_loop, margins};
use rayon::prelude::*;
use serde::Serialize;

/// A crane of a family at a piston position, and how far a loop around it is from ringing on.
#[derive(Clone, Debug, Serialize)]
pub struct MemberMargins {
    /// The crane's number.
    pub crane: u64,
    /// Where its piston is.
    pub stroke_mm: f64,
    /// Its margins there.
    pub margins: Margins,
}

impl MemberMargins {
    /// Distance from −1, negative where the loop is unstable.
    fn signed_distance(&self) -> f64 {
        match self.margins.growing {
            0 => self.margins.distance,
            _ => -self.margins.distance,
        }
    }
}

/// Margins of a controller's loop over a family.
#[derive(Clone, Debug, Serialize)]
pub struct FamilyMargins {
    /// The controller.
    pub controller: &'static str,
    /// Cranes and piston positions that were looked at.
    pub count: usize,
    /// Of these, the loop is unstable.
    pub ringing_on: usize,
    /// Distance from −1, negative where the loop is unstable: a twentieth is below.
    pub distance_p5: f64,
    /// Half are below.
    pub distance_median: f64,
    /// The crane and position nearest to ringing on, or furthest beyond.
    pub worst: MemberMargins,
}

impl FamilyMargins {
    fn of(controller: &'static str, mut all: Vec<MemberMargins>) -> Option<Self> {
        all.sort_by(|a, b| a.signed_distance().total_cmp(&b.signed_distance()));
        let distances = Spread::of(all.iter().map(MemberMargins::signed_distance));
        Some(Self {
            controller,
            count: all.len(),
            ringing_on: all.iter().filter(|m| m.margins.growing > 0).count(),
            distance_p5: distances.p5,
            distance_median: distances.median,
            worst: all.into_iter().next()?,
        })
    }
}

/// Margins of the benchmark's loop over a family of virtual cranes, each at three piston positions: a controller that knows the model alone, around cranes that
/// are linearised as they are.
///
/// # Errors
///
/// [`LabError`] when a crane cannot be built or linearised.
pub fn family_margins(
    model: &Description,
    count: u64,
    seed: u64,
) -> Result<FamilyMargins, LabError> {
    let nominal = Description::uia_virtual()?;
    let around = benchmark_loop(model);
    let cases: Vec<(u64, f64)> =
        (0..count).flat_map(|k| [0.1, 0.5, 0.9].map(|share| (k, share))).collect();
    let of = |(number, share): &(u64, f64)| -> Result<MemberMargins, LabError> {
        let crane = member(&nominal, seed, *number)?.crane;
        let stroke = share * model.numbers.stroke;
        let margins = margins(&Lifting::new(&crane, stroke)?, &around)?;
        Ok(MemberMargins { crane: *number, stroke_mm: stroke * 1e3, margins })
    };
    let all = cases.par_iter().map(of).collect::<Result<Vec<_>, LabError>>()?;
    let none = || LabError::NoOscillation("a family of no cranes has no margins".into());
    FamilyMargins::of("benchmark", all).ok_or_else(none)
}
