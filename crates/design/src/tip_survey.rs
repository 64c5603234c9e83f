//! Calibration of the tip estimator by a survey of the boom's tip.
//!
//! A survey is a CSV file, a line a pose at rest: piston position that is read, payload that was weighed, tip as
//! surveyed from the boom's bearing. Weighted least squares with the stated spread of the numbers as a prior:
//!
//! ```text
//! θ = argmin Σ (t_i − t(θ))²/(s_i² + r²) + (θ − θ_0)' P_0⁻¹ (θ − θ_0),   P = (P_0⁻¹ + J' R⁻¹ J)⁻¹
//! ```
//!
//! with surveyed coordinates t of standard deviation s, and r what the model leaves out. Bending and base lower the
//! tip nearly alike: a survey tells their sum well, and each hardly.
//!
//! Source: A. Gelb (ed.), *Applied Optimal Estimation*, 1974, section 4.1 (least squares with a prior).

use hydroboom_control::estimation::error_covariance::Covariance;
use hydroboom_control::estimation::tip::{PARAMETERS, TipEstimator, TipLoad, TipParameters};
use hydroboom_description::Description;
use hydroboom_math::Real;
use nalgebra::{Matrix3, Vector3};
use std::fmt::Write;
use thiserror::Error;

/// Columns of a survey, with their units.
pub const COLUMNS: [&str; 5] = ["stroke_mm", "payload_kg", "tip_x_mm", "tip_y_mm", "deviation_mm"];
/// Poses that a survey has at least.
const FEWEST: usize = 4;
/// Distance of a surveyed tip from that of a rigid boom, over the boom's length, beyond which it is no tip of this
/// crane.
const FARTHEST: f64 = 0.1;

/// Reason why a survey cannot be read or fitted.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SurveyError {
    /// A line, or the whole file, is wrong.
    #[error("{place}: {reason}; {advice}")]
    Wrong {
        /// File, and line if it is a single one.
        place: String,
        /// What was read.
        reason: String,
        /// What is allowed, or what to do.
        advice: String,
    },
    /// The crane's tip cannot be estimated.
    #[error(
        "the tip of \"{0}\" is not estimated: its boom is no beam that the cylinder holds between bearing and tip"
    )]
    NoTip(String),
    /// The normal equations of this file's fit have no solution.
    #[error(
        "{0}: the numbers of the tip cannot be fitted; state a spread above zero for tip.bending_deviation_percent, tip.base_deviation_mrad_per_knm and tip.stroke_offset_deviation_mm"
    )]
    NoFit(String),
}

/// Surveyed pose of the boom at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurveyPoint {
    /// Line in the file, from 1.
    pub line: usize,
    /// Measured piston position \[m\].
    pub stroke: f64,
    /// Weighed payload \[kg\].
    pub payload: f64,
    /// Surveyed position of the tip, right of and above the bearing \[m\].
    pub tip: [f64; 2],
    /// Standard deviation of each of its coordinates \[m\].
    pub deviation: f64,
}

impl SurveyPoint {
    fn load(&self) -> TipLoad<f64> {
        TipLoad { piston: self.stroke, payload: self.payload, acceleration: 0.0 }
    }

    /// Pose in a row of a survey, with the places of its columns: each number in its range, and the tip near that of a
    /// rigid boom. `wrong` makes an error of line, reason and advice.
    fn read(
        row: &csv::StringRecord,
        places: [usize; COLUMNS.len()],
        description: &Description,
        estimator: &TipEstimator<f64>,
        wrong: &impl Fn(Option<usize>, String, &str) -> SurveyError,
    ) -> Result<Self, SurveyError> {
        let line = row.position().map_or(0, |place| place.line() as usize);
        let mut numbers = [0.0; COLUMNS.len()];
        for ((number, place), column) in numbers.iter_mut().zip(places).zip(COLUMNS) {
            let text = row.get(place).unwrap_or("nothing");
            *number = text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
                let reason = format!("{column} is {text}");
                wrong(Some(line), reason, "it is a number")
            })?;
        }
        let [stroke, payload, x, y, deviation] = numbers;
        let longest = description.numbers.stroke * 1e3;
        for (column, value, low, high, unit) in [
            ("stroke_mm", stroke, 0.0, longest, "mm, the cylinder's stroke"),
            ("payload_kg", payload, 0.0, 1e6, "kg"),
            ("deviation_mm", deviation, 1e-3, 100.0, "mm"),
        ] {
            if !(low..=high).contains(&value) {
                let advice = format!("it is from {low} to {high} {unit}");
                return Err(wrong(Some(line), format!("{column} is {value}"), &advice));
            }
        }
        let point = Self {
            line,
            stroke: stroke * 1e-3,
            payload,
            tip: [x * 1e-3, y * 1e-3],
            deviation: deviation * 1e-3,
        };
        let rigid = TipParameters { bending: 0.0, base: 0.0, stroke_offset: 0.0 };
        let [rigid_x, rigid_y] = estimator.model.position(&rigid, &point.load());
        let off = (point.tip[0] - rigid_x).hypot(point.tip[1] - rigid_y);
        if off > FARTHEST * estimator.model.length {
            let reason = format!(
                "tip_x_mm, tip_y_mm is {x}, {y}, and a rigid boom's tip at {stroke} mm is {:.0}, {:.0}",
                rigid_x * 1e3,
                rigid_y * 1e3
            );
            let advice = "positions are from the boom's bearing, to the right and upwards, in mm";
            return Err(wrong(Some(line), reason, advice));
        }
        Ok(point)
    }
}

/// Refuses poses that are too few, or alike in stroke or payload.
fn check_poses(
    points: &[SurveyPoint],
    description: &Description,
    wrong: impl Fn(Option<usize>, String, &str) -> SurveyError,
) -> Result<(), SurveyError> {
    let differ = |of: fn(&SurveyPoint) -> f64, by: f64| {
        let values = || points.iter().map(of);
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min) >= by
    };
    let advice = "survey five poses over the stroke, each empty and with a heavy load";
    if points.len() < FEWEST {
        let reason = format!("{} poses, and at least {FEWEST} are needed", points.len());
        return Err(wrong(None, reason, advice));
    }
    if !differ(|p| p.stroke, 0.2 * description.numbers.stroke) {
        return Err(wrong(None, "poses over less than a fifth of the stroke".into(), advice));
    }
    if !differ(|p| p.payload, 1.0) {
        return Err(wrong(None, "a single load".into(), advice));
    }
    Ok(())
}

/// Survey of the boom's tip at several poses.
#[derive(Clone, Debug, PartialEq)]
pub struct TipSurvey {
    /// Name of the file.
    pub file: String,
    /// Surveyed poses.
    pub points: Vec<SurveyPoint>,
}

/// Parameters of the tip estimator fitted to a survey.
#[derive(Clone, Debug, PartialEq)]
pub struct SurveyFit {
    /// Tip estimator with fitted parameters and their covariance.
    pub estimator: TipEstimator<f64>,
    /// Part of the parameters' covariance caused by the survey's noise alone.
    pub noise: Covariance<f64, PARAMETERS>,
    /// RMS residual across the boom \[m\].
    pub residual: f64,
    /// Line of the pose with the largest residual, and this residual relative to its standard deviation \[1\].
    pub worst: (usize, f64),
}

impl TipSurvey {
    /// Parses and checks a survey of a crane. `file` is its name, for messages.
    ///
    /// # Errors
    ///
    /// [`SurveyError::Wrong`] with file, line and column: a missing column, a value that is no number or out of
    /// range, a tip of another crane. Also for too few poses, positions or loads. [`SurveyError::NoTip`] if the
    /// crane's tip cannot be estimated.
    pub fn parse(file: &str, text: &str, description: &Description) -> Result<Self, SurveyError> {
        let estimator = tip_of(description)?;
        let expected = format!("the columns are {}", COLUMNS.join(","));
        let wrong = |line: Option<usize>, reason: String, advice: &str| SurveyError::Wrong {
            place: line.map_or_else(|| file.into(), |line| format!("{file}, line {line}")),
            reason,
            advice: advice.into(),
        };
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(text.as_bytes());
        let header =
            reader.headers().map_err(|error| wrong(None, error.to_string(), &expected))?.clone();
        if header.is_empty() {
            return Err(wrong(None, "nothing in it".into(), &expected));
        }
        let mut places = [0; COLUMNS.len()];
        for (place, column) in places.iter_mut().zip(COLUMNS) {
            let found = header.iter().position(|name| name == column);
            *place = found.ok_or_else(|| wrong(None, format!("no column {column}"), &expected))?;
        }
        let mut points = Vec::new();
        for row in reader.records() {
            let row = row.map_err(|error| wrong(None, error.to_string(), &expected))?;
            points.push(SurveyPoint::read(&row, places, description, &estimator, &wrong)?);
        }
        check_poses(&points, description, wrong)?;
        Ok(Self { file: file.into(), points })
    }

    /// Survey as CSV text, as [`parse`](Self::parse) reads it.
    pub fn text(&self) -> String {
        let mut text = String::from(
            "# Survey of the boom's tip at rest: piston position that is read, payload, tip to the right of the boom's bearing\n\
             # and above it, standard deviation of each of its coordinates.\n",
        );
        text += &COLUMNS.join(",");
        for SurveyPoint { stroke, payload, tip: [x, y], deviation, .. } in &self.points {
            let [stroke, x, y, deviation] = [stroke, x, y, deviation].map(|v| v * 1e3);
            // writing to a string does not fail
            let _ = write!(text, "\n{stroke:.3},{payload:.2},{x:.3},{y:.3},{deviation:.3}");
        }
        text + "\n"
    }

    /// Fits the parameters of the crane's tip estimator to the survey, with the crane file's parameters and spread as
    /// a prior.
    ///
    /// # Errors
    ///
    /// [`SurveyError::NoTip`] if the crane's tip cannot be estimated, [`SurveyError::NoFit`] if a spread is zero or
    /// the normal equations have no solution.
    pub fn fit(&self, description: &Description) -> Result<SurveyFit, SurveyError> {
        let prior = tip_of(description)?;
        let no_fit = || SurveyError::NoFit(self.file.clone());
        let prior_covariance = Matrix3::from_fn(|i, j| prior.covariance[i][j]);
        let from = Vector3::from(prior.parameters.to_array());
        // in units of the prior's deviations, so that the equations are of one size
        let scale = Vector3::from_fn(|i, _| prior.covariance[i][i].sqrt());
        let scaled = Matrix3::from_fn(|i, j| prior_covariance[(i, j)] / (scale[i] * scale[j]));
        let information = scaled.try_inverse().ok_or_else(no_fit)?;
        let mut estimator = prior;
        let mut at = Vector3::zeros();
        let mut survey_information = Matrix3::zeros();
        let mut by_survey = Matrix3::zeros();
        // nearly linear: the second step changes the last digits
        for _ in 0..5 {
            (survey_information, by_survey) = (Matrix3::zeros(), Matrix3::zeros());
            let mut right = -(information * at);
            for point in &self.points {
                let found = estimator.model.position(&estimator.parameters, &point.load());
                let (slopes, _) = estimator.slopes(&point.load());
                // the model's error is across the boom
                for (direction, model_error) in
                    directions(found).into_iter().zip([0.0, prior.remainder])
                {
                    let along = |of: [f64; 2]| direction[0] * of[0] + direction[1] * of[1];
                    let by_parameter = Vector3::from_fn(|i, _| along([slopes[0][i], slopes[1][i]]));
                    let row = by_parameter.component_mul(&scale);
                    let weight = 1.0 / (point.deviation.powi(2) + model_error.powi(2));
                    survey_information += row * row.transpose() * weight;
                    by_survey += row * row.transpose() * (weight * point.deviation).powi(2);
                    right +=
                        row * (weight * along([point.tip[0] - found[0], point.tip[1] - found[1]]));
                }
            }
            let step = (information + survey_information).try_inverse().ok_or_else(no_fit)? * right;
            at += step;
            let numbers = from + at.component_mul(&scale);
            estimator.parameters = TipParameters::from_array(numbers.into());
        }
        let posterior = (information + survey_information).try_inverse().ok_or_else(no_fit)?;
        // of the survey's noise alone: the estimator adds the model's error itself
        let noise = posterior * by_survey * posterior;
        let unscaled = |of: &Matrix3<f64>| -> Covariance<f64, PARAMETERS> {
            std::array::from_fn(|i| std::array::from_fn(|j| of[(i, j)] * scale[i] * scale[j]))
        };
        estimator.covariance = unscaled(&posterior);
        let left: Vec<(usize, f64, f64)> =
            self.points.iter().map(|point| left_at(&estimator, point)).collect();
        let worst = left.iter().copied().max_by(|a, b| a.2.total_cmp(&b.2)).ok_or_else(no_fit)?;
        let squares: f64 = left.iter().map(|(_, residual, _)| residual.powi(2)).sum();
        Ok(SurveyFit {
            estimator,
            noise: unscaled(&noise),
            residual: (squares / left.len() as f64).sqrt(),
            worst: (worst.0, worst.2),
        })
    }
}

/// Unit vectors along the boom and across it, for a tip from the bearing.
fn directions([x, y]: [f64; 2]) -> [[f64; 2]; 2] {
    let length = x.hypot(y).max(f64::MIN_POSITIVE);
    [[x / length, y / length], [-y / length, x / length]]
}

/// Line of a pose, its residual across the boom \[m\], and the larger of those across and along it, over their
/// standard deviations.
fn left_at(estimator: &TipEstimator<f64>, point: &SurveyPoint) -> (usize, f64, f64) {
    let found = estimator.model.position(&estimator.parameters, &point.load());
    let off = [point.tip[0] - found[0], point.tip[1] - found[1]];
    let [along, across] = directions(found).map(|d| d[0] * off[0] + d[1] * off[1]);
    let normalised = across.abs() / point.deviation.hypot(estimator.remainder);
    (point.line, across, normalised.max(along.abs() / point.deviation))
}

fn tip_of(description: &Description) -> Result<TipEstimator<f64>, SurveyError> {
    crate::tip::tip_estimator(description)
        .ok_or_else(|| SurveyError::NoTip(description.name.clone()))
}

impl SurveyFit {
    /// Keys of the crane file's section `tip` with the fitted values in SI units, whatever unit the key names. A
    /// correlation with a parameter without spread is 0.
    pub fn keys(&self) -> [(&'static str, f64); 9] {
        let TipParameters { bending, base, stroke_offset } = self.estimator.parameters;
        let c = &self.estimator.covariance;
        let deviation = |i: usize| c[i][i].max(0.0).sqrt();
        let correlation = |i: usize, j: usize| {
            let correlation = c[i][j] / (deviation(i) * deviation(j));
            if correlation.is_finite() { Real::clamp(correlation, -1.0, 1.0) } else { 0.0 }
        };
        [
            ("tip.bending_percent", bending),
            ("tip.bending_deviation_percent", deviation(0)),
            ("tip.base_mrad_per_knm", base),
            ("tip.base_deviation_mrad_per_knm", deviation(1)),
            ("tip.stroke_offset_mm", stroke_offset),
            ("tip.stroke_offset_deviation_mm", deviation(2)),
            ("tip.bending_base_correlation", correlation(0, 1)),
            ("tip.bending_offset_correlation", correlation(0, 2)),
            ("tip.base_offset_correlation", correlation(1, 2)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crane() -> Description {
        Description::uia_single_boom().unwrap()
    }

    /// A survey without noise of a tip with these numbers.
    fn survey(parameters: &TipParameters<f64>, deviation: f64) -> TipSurvey {
        let model = tip_of(&crane()).unwrap().model;
        let mut points = Vec::new();
        for payload in [0.0, 307.0] {
            for stroke in [0.05, 0.15, 0.25, 0.35, 0.45] {
                let load = TipLoad { piston: stroke, payload, acceleration: 0.0 };
                let tip = model.position(parameters, &load);
                points.push(SurveyPoint { line: 0, stroke, payload, tip, deviation });
            }
        }
        TipSurvey { file: "survey.csv".into(), points }
    }

    #[test]
    fn a_survey_without_noise_recovers_the_parameters() {
        let wanted = TipParameters { bending: 1.2, base: 0.1e-6, stroke_offset: 4e-4 };
        let mut exact = crane();
        exact.numbers.tip_remainder = 0.0;
        let fit = survey(&wanted, 1e-7).fit(&exact).unwrap();
        let found = fit.estimator.parameters;
        assert!((found.bending - 1.2).abs() < 1e-3, "{found:?}");
        assert!((found.base - 0.1e-6).abs() < 1e-9, "{found:?}");
        assert!((found.stroke_offset - 4e-4).abs() < 1e-6, "{found:?}");
        assert!(fit.residual < 1e-7, "{}", fit.residual);
    }

    /// A survey with an accuracy of 1 mm determines the sum of bending and base compliance, and not
    /// each of them.
    #[test]
    fn a_survey_determines_the_sum_of_bending_and_base_only() {
        let as_stated = tip_of(&crane()).unwrap();
        let fit = survey(&as_stated.parameters, 1e-3).fit(&crane()).unwrap();
        let [.., (_, correlation), _, _] = fit.keys();
        assert!(correlation < -0.8, "{correlation}");
        let load = TipLoad { piston: 0.25, payload: 307.0, acceleration: 0.0 };
        let deviation = |estimator: &TipEstimator<f64>| {
            let ([_, slopes], _) = estimator.slopes(&load);
            hydroboom_control::estimation::error_covariance::output_deviation(
                &estimator.covariance,
                &slopes,
            )
        };
        let [before, after] = [&as_stated, &fit.estimator].map(deviation);
        assert!(before > 2e-3 && after < 0.5e-3, "{before} and {after} m");
    }

    #[test]
    fn a_written_survey_is_read_back() {
        let as_stated = tip_of(&crane()).unwrap().parameters;
        let written = survey(&as_stated, 1e-3);
        let read = TipSurvey::parse("survey.csv", &written.text(), &crane()).unwrap();
        for (a, b) in written.points.iter().zip(&read.points) {
            assert!((a.tip[1] - b.tip[1]).abs() < 1e-6 && (a.stroke - b.stroke).abs() < 1e-9);
        }
    }

    /// The message states file, line and column, what was read and what is allowed.
    #[test]
    fn bad_surveys_are_refused_with_file_and_line() {
        let good = survey(&tip_of(&crane()).unwrap().parameters, 1e-3).text();
        let refused = |text: &str, parts: &[&str]| {
            let message = TipSurvey::parse("s.csv", text, &crane()).unwrap_err().to_string();
            for part in parts {
                assert!(message.contains(part), "\"{part}\" is not in: {message}");
            }
        };
        refused("", &["s.csv", "nothing in it", "stroke_mm,payload_kg"]);
        refused(&good.replace("payload_kg", "load_kg"), &["s.csv", "no column payload_kg"]);
        let line = |k: usize, text: &str| {
            let mut lines: Vec<&str> = good.lines().collect();
            lines[k - 1] = text;
            lines.join("\n")
        };
        refused(&line(5, "150,abc,3400,100,1"), &["line 5", "payload_kg is abc", "number"]);
        refused(&line(5, "150,307,3400"), &["line 5", "tip_y_mm is nothing"]);
        refused(&line(6, "650,307,3400,100,1"), &["line 6", "stroke_mm is 650", "from 0 to 500"]);
        refused(&line(6, "250,-3,3400,100,1"), &["line 6", "payload_kg is -3"]);
        refused(&line(6, "250,307,3400,100,0"), &["line 6", "deviation_mm is 0"]);
        refused(&line(6, "250,307,3.4,0.1,1"), &["line 6", "tip_x_mm", "bearing", "in mm"]);
        let few: Vec<&str> = good.lines().take(5).collect();
        refused(&few.join("\n"), &["2 poses, and at least 4"]);
        let light: Vec<&str> = good.lines().take(8).collect();
        refused(&light.join("\n"), &["a single load", "heavy load"]);
    }
}
