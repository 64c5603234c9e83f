//! Stability margins of benchmark and scheduled LQR on a family of virtual cranes.

use crate::LabError;
use crate::closed_loop::monte_carlo::{Percentiles, member};
use hydroboom_description::{Description, millimetres};
use hydroboom_design::scheduled_lqr::{designed, known_delay};
use hydroboom_design::stability::with_identified;
use hydroboom_design::{
    LinearisedPlant, Loop, Margins, benchmark_loop, margins, scheduled_lqr_loop_at,
};
use rayon::prelude::*;
use serde::Serialize;

/// Stability margins of a control loop on one crane of a family at one piston position.
#[derive(Clone, Debug, Serialize)]
pub struct MemberMargins {
    /// Number of the crane in the family.
    pub crane: u64,
    /// Piston position \[mm\].
    pub stroke_mm: f64,
    /// Gain, phase and modulus margin at this piston position.
    pub margins: Margins,
}

impl MemberMargins {
    /// Modulus margin, negative for an unstable loop: orders loops by their distance to instability.
    fn signed_modulus_margin(&self) -> f64 {
        match self.margins.unstable_poles {
            0 => self.margins.modulus_margin,
            _ => -self.margins.modulus_margin,
        }
    }
}

/// Distribution of a controller's stability margins over a family.
#[derive(Clone, Debug, Serialize)]
pub struct FamilyMargins {
    /// Name of the controller and its state of identification.
    pub controller: &'static str,
    /// Number of loops: cranes times piston positions.
    pub count: usize,
    /// Number of loops that are unstable.
    pub unstable: usize,
    /// 5th percentile of the modulus margin of the stable loops \[-\]: smallest distance of the Nyquist curve from −1.
    /// This and the other percentiles are NaN if no loop is stable.
    pub modulus_margin_p5: f64,
    /// Median of the modulus margin of the stable loops \[-\].
    pub modulus_margin_median: f64,
    /// 5th percentile of the phase margin of the stable loops \[deg\].
    pub phase_p5_deg: f64,
    /// Median of the phase margin of the stable loops \[deg\].
    pub phase_median_deg: f64,
    /// 5th percentile of the gain margin, a factor \[-\], of the stable loops that have one; NaN if none has.
    pub gain_p5: f64,
    /// Median of the gain margin, a factor \[-\], of the stable loops that have one; NaN if none has.
    pub gain_median: f64,
    /// Crane and position of smallest margin; if loops are unstable, the one furthest from stability.
    pub worst: MemberMargins,
}

impl FamilyMargins {
    fn of(controller: &'static str, mut all: Vec<MemberMargins>) -> Option<Self> {
        all.sort_by(|a, b| a.signed_modulus_margin().total_cmp(&b.signed_modulus_margin()));
        let stable = || all.iter().filter(|m| m.margins.unstable_poles == 0).map(|m| m.margins);
        let moduli = Percentiles::of(stable().map(|m| m.modulus_margin));
        let phases = Percentiles::of(stable().map(|m| m.phase_deg));
        let gains = Percentiles::of(stable().map(|m| m.gain));
        Some(Self {
            controller,
            count: all.len(),
            unstable: all.iter().filter(|m| m.margins.unstable_poles > 0).count(),
            modulus_margin_p5: moduli.p5,
            modulus_margin_median: moduli.median,
            phase_p5_deg: phases.p5,
            phase_median_deg: phases.median,
            gain_p5: gains.p5,
            gain_median: gains.median,
            worst: all.into_iter().next()?,
        })
    }
}

/// Stability margins over a family of virtual cranes, drawn around a nominal crane, each at three piston positions, of
/// three loops. They are the benchmark's, the scheduled LQR's before any identification, and the scheduled LQR's with
/// oil and drive identified.
///
/// The controllers use the model and the payload, which the estimator identifies at rest. Lag of the drive
/// and stiffness of the oil are those of the crane file, or of the crane if identified. The cranes are
/// linearised with their own drive, fieldbus and position sensor. If the strokes of model and cranes differ, the
/// positions are shares of the shorter one.
///
/// # Errors
///
/// [`LabError::Description`] if a crane of the family cannot exist; [`LabError::Design`] if a controller cannot be
/// designed or a crane cannot be linearised. [`LabError::NoOscillation`] if `count` is zero.
pub fn family_margins(
    model: &Description,
    nominal: &Description,
    (count, seed): (u64, u64),
) -> Result<Vec<FamilyMargins>, LabError> {
    let benchmark = benchmark_loop(model);
    let design = designed(model, known_delay(model) as usize)?;
    let cases: Vec<(u64, f64)> =
        (0..count).flat_map(|k| [0.1, 0.5, 0.9].map(|share| (k, share))).collect();
    let of = |(number, share): &(u64, f64)| -> Result<[MemberMargins; 3], LabError> {
        let crane = member(nominal, seed, *number)?.crane;
        let stroke = share * model.numbers.stroke.min(crane.numbers.stroke);
        let linear = LinearisedPlant::new(&crane, stroke)?;
        let payload = crane.numbers.payload;
        let scheduled_lqr = scheduled_lqr_loop_at(model, &design, stroke, payload);
        let known = with_identified(model, &crane);
        let identified = designed(&known, known_delay(&known) as usize)?;
        let identified = scheduled_lqr_loop_at(&known, &identified, stroke, payload);
        let around = |looked_at: Loop| -> Result<MemberMargins, LabError> {
            let margins = margins(&linear, &looked_at.on(&crane))?;
            Ok(MemberMargins { crane: *number, stroke_mm: millimetres(stroke), margins })
        };
        Ok([around(benchmark.clone())?, around(scheduled_lqr)?, around(identified)?])
    };
    let all = cases.par_iter().map(of).collect::<Result<Vec<_>, LabError>>()?;
    let none = || LabError::NoOscillation("a family of no cranes has no margins".into());
    ["benchmark", "scheduled LQR, nothing identified", "scheduled LQR, oil and drive identified"]
        .into_iter()
        .enumerate()
        .map(|(k, name)| {
            let of = all.iter().map(|margins| margins[k].clone()).collect();
            FamilyMargins::of(name, of).ok_or_else(none)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cranes with payloads within both controllers' design range.
    #[test]
    fn both_controllers_are_evaluated_on_the_same_cranes() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = Description::uia_virtual().unwrap();
        let family = family_margins(&model, &nominal, (2, 1)).unwrap();
        let [benchmark, scheduled_lqr, identified] = &family[..] else {
            panic!("three loops are looked at")
        };
        assert_eq!((benchmark.count, scheduled_lqr.count, identified.count), (6, 6, 6));
        assert_eq!(identified.unstable, 0);
        assert_eq!((benchmark.unstable, scheduled_lqr.unstable), (0, 0));
        assert!(scheduled_lqr.modulus_margin_p5 > benchmark.modulus_margin_p5, "{scheduled_lqr:?}");
        assert!(scheduled_lqr.phase_p5_deg > benchmark.phase_p5_deg, "{benchmark:?}");
    }

    /// A weaker beam lowers the natural frequency of the load. The same model and gains then have other margins.
    #[test]
    fn margins_are_those_of_the_crane_that_the_family_is_drawn_around() {
        let model = Description::uia_single_boom().unwrap();
        let nominal = model.virtual_crane().0;
        let mut weak = nominal.clone();
        weak.set("boom.second_moment_cm4=700").unwrap();
        let moduli = |nominal: &Description| {
            let family = family_margins(&model, nominal, (1, 1)).unwrap();
            family.iter().map(|of| of.worst.signed_modulus_margin()).collect::<Vec<_>>()
        };
        for (of_nominal, of_weak) in moduli(&nominal).into_iter().zip(moduli(&weak)) {
            assert!((of_nominal - of_weak).abs() > 1e-3, "{of_nominal} and {of_weak}");
        }
        // the positions are within the stroke of the cranes
        let mut long = model.clone();
        long.set("cylinder.stroke_mm=600").unwrap();
        assert!(family_margins(&long, &nominal, (1, 1)).is_ok());
    }
}
