//! Baseline of the tip's height: regression on stroke and payload.

use hydroboom_control::estimation::tip::TipLoad;
use hydroboom_design::tip_survey::TipSurvey;
use nalgebra::{Matrix4, Vector4};

/// Baseline: loss of height, c_0 + c_1 x + (c_2 + c_3 x) m, by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HeightMap(Vector4<f64>);

impl HeightMap {
    fn features(load: &TipLoad<f64>) -> Vector4<f64> {
        // scaled to similar magnitudes
        let (x, m) = (load.piston * 2.0, load.payload * 3e-3);
        Vector4::new(1.0, x, m, x * m)
    }

    /// Fit to a survey, from the height of a rigid boom \[m\] at a piston position \[m\]; none for poses too alike.
    pub(super) fn fit(survey: &TipSurvey, rigid: &dyn Fn(f64) -> f64) -> Option<Self> {
        let (mut left, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for p in &survey.points {
            let load = TipLoad { piston: p.stroke, payload: p.payload, acceleration: 0.0 };
            let row = Self::features(&load);
            let weight = p.deviation.powi(-2);
            left += row * row.transpose() * weight;
            right += row * (weight * (p.tip[1] - rigid(p.stroke)));
        }
        left.try_inverse().map(|inverse| Self(inverse * right))
    }

    /// Loss of height \[m\].
    pub(super) fn at(&self, load: &TipLoad<f64>) -> f64 {
        self.0.dot(&Self::features(load))
    }
}
