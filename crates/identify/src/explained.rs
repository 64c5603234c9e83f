//! Decomposition of a difference by regression: offset, drift, scale and delay.

use nalgebra::{DMatrix, DVector};

/// Components of a difference log − model, by multiple linear regression (ordinary least squares).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Explained {
    /// Constant offset, in the middle of the log \[SI unit of the signal\].
    pub offset: Part,
    /// Growth of the offset \[SI unit of the signal per s\].
    pub drift: Part,
    /// Relative scale error \[-\]: share by which the log's amplitude exceeds the model's.
    pub scale: Part,
    /// Delay of the log \[s\], to first order: the coefficient of the model's time derivative.
    pub delay: Part,
}

/// One component of a difference: regression coefficient and its share of the power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Regression coefficient; its unit is stated at the component in [`Explained`].
    pub value: f64,
    /// Share of the difference's mean square that only this component explains, given the others \[-\], 0 to 1.
    pub share: f64,
}

/// Decomposition of log − model into offset, drift, scale and delay. Both are sampled at the same times with the
/// `interval` \[s\], with none for missing samples, in the SI unit of the signal. None if fewer than 20 times have
/// both, if log and model are equal, or if the regression fails.
pub fn explained(log: &[Option<f64>], model: &[Option<f64>], interval: f64) -> Option<Explained> {
    let at = |k: usize| model.get(k).copied().flatten();
    // central difference, or one-sided beside a gap
    let slope = |k: usize, own: f64| {
        let (before, after) = (k.checked_sub(1).and_then(at), at(k + 1));
        let steps = u8::from(before.is_some()) + u8::from(after.is_some());
        let rise = after.unwrap_or(own) - before.unwrap_or(own);
        rise / (f64::from(steps.max(1)) * interval)
    };
    let both: Vec<(f64, f64, f64, f64)> = (0..log.len().min(model.len()))
        .filter_map(|k| {
            let (seen, shown) = (log[k]?, model[k]?);
            Some((k as f64 * interval, seen - shown, shown, slope(k, shown)))
        })
        .collect();
    let count = both.len();
    if count < 20 {
        return None;
    }
    let (middle, mean) = both
        .iter()
        .fold((0.0, 0.0), |(time, mean), b| (time + b.0 / count as f64, mean + b.2 / count as f64));
    let along = DMatrix::from_fn(count, 4, |k, part| match part {
        0 => 1.0,
        1 => both[k].0 - middle,
        2 => both[k].2 - mean,
        _ => -both[k].3,
    });
    let errors = DVector::from_fn(count, |k, _| both[k].1);
    let power = errors.norm_squared();
    if power <= 0.0 {
        return None;
    }
    let fitted = |parts: &[usize]| {
        let columns = along.select_columns(parts);
        let sizes: Vec<f64> = columns.column_iter().map(|c| c.norm().max(1e-300)).collect();
        let scaled = DMatrix::from_fn(count, parts.len(), |k, j| columns[(k, j)] / sizes[j]);
        // pseudo-inverse: a constant or collinear regressor gets no weight
        let normal = scaled.tr_mul(&scaled);
        let inverse = normal.svd(true, true).pseudo_inverse(1e-6).ok()?;
        let found = inverse * scaled.tr_mul(&errors);
        let left = (&errors - scaled * &found).norm_squared();
        Some((found.iter().zip(&sizes).map(|(v, s)| v / s).collect::<Vec<f64>>(), left))
    };
    let (values, left) = fitted(&[0, 1, 2, 3])?;
    let part = |k: usize| {
        let others: Vec<usize> = (0..4).filter(|other| *other != k).collect();
        let (_, without) = fitted(&others)?;
        Some(Part { value: values[k], share: ((without - left) / power).max(0.0) })
    };
    Some(Explained { offset: part(0)?, drift: part(1)?, scale: part(2)?, delay: part(3)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: f64 = 5e-3;

    /// Ten seconds of a model with a slow motion and an oscillation.
    fn model(time: f64) -> f64 {
        70.0 + 4.0 * (0.9 * time).sin() + (14.0 * time).sin()
    }

    fn parts(log: impl Fn(f64) -> f64) -> Explained {
        explained(&course(log, |_| true), &course(model, |_| true), INTERVAL).unwrap()
    }

    /// Samples over ten seconds; none where nothing was measured.
    fn course(of: impl Fn(f64) -> f64, is_there: impl Fn(f64) -> bool) -> Vec<Option<f64>> {
        let times = (0..2000).map(|k| f64::from(k) * INTERVAL);
        times.map(|t| Some(of(t)).filter(|_| is_there(t))).collect()
    }

    /// The only component that explains a difference; the others must explain nothing.
    fn only(found: Explained, which: usize) -> f64 {
        let all = [found.offset, found.drift, found.scale, found.delay];
        for (k, part) in all.iter().enumerate() {
            assert_eq!(part.share > 0.3, k == which, "{found:?}");
        }
        all[which].value
    }

    #[test]
    fn offset_drift_scale_and_delay_are_distinguished() {
        assert!((only(parts(|t| model(t) + 0.7), 0) - 0.7).abs() < 1e-6);
        assert!((only(parts(|t| model(t) + 0.2 * (t - 5.0)), 1) - 0.2).abs() < 1e-3);
        let mean = 70.0 + 4.0 * (1.0 - 9.0_f64.cos()) / 9.0;
        assert!((only(parts(|t| mean + 1.1 * (model(t) - mean)), 2) - 0.1).abs() < 1e-3);
        assert!((only(parts(|t| model(t - 4e-3)), 3) - 4e-3).abs() < 2e-4);
    }

    /// A gap keeps its duration: the drift is per unit of time, and no slope is taken across the gap.
    #[test]
    fn a_gap_does_not_change_the_estimated_sensor_errors() {
        let is_there = |t: f64| !(2.0..7.0).contains(&t);
        let mean = 70.0 + 4.0 * (1.0 - 9.0_f64.cos()) / 9.0;
        let log = |t: f64| {
            let shown = model(t - 3e-3);
            shown + 0.7 + 0.2 * (t - 5.0) + 0.05 * (shown - mean)
        };
        let found = explained(&course(log, is_there), &course(model, is_there), INTERVAL).unwrap();
        let near = |a: f64, b: f64, share: f64| assert!((a - b).abs() < share * b, "{found:?}");
        near(found.drift.value, 0.2, 0.01);
        near(found.scale.value, 0.05, 0.03);
        // first-order approximation: the oscillation's phase changes by 0.04 rad in the delay
        near(found.delay.value, 3e-3, 0.08);
    }

    #[test]
    fn another_oscillation_is_no_sensor_error() {
        let found = parts(|t| model(t) + 0.5 * (25.0 * t).sin());
        for part in [found.offset, found.drift, found.scale, found.delay] {
            assert!(part.share < 0.1, "{found:?}");
        }
    }
}
