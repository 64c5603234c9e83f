//! Sparkline: a signal as one line of text.

const STEPS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Line of `width` block characters, or of one a value if there are fewer values. Each shows the mean of its part of
/// the values, in eight steps from the smallest to the largest value. Equal values show as the fifth step; where all
/// are missing (NaN or infinite) the place is blank.
pub fn sparkline(values: &[f64], width: usize) -> String {
    let there = || values.iter().copied().filter(|v| v.is_finite());
    let (low, high) =
        there().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let width = width.min(values.len());
    (0..width)
        .map(|k| {
            let part = &values[k * values.len() / width..(k + 1) * values.len() / width];
            let some: Vec<f64> = part.iter().copied().filter(|v| v.is_finite()).collect();
            if some.is_empty() {
                return ' ';
            }
            let mean = some.iter().sum::<f64>() / some.len() as f64;
            let share = if high > low { (mean - low) / (high - low) } else { 0.5 };
            STEPS[((share * 8.0) as usize).min(7)]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sparkline_rises_with_a_ramp_and_is_blank_in_a_gap() {
        let ramp: Vec<f64> = (0..80).map(f64::from).collect();
        assert_eq!(sparkline(&ramp, 8), "▁▂▃▄▅▆▇█");
        let mut broken = ramp;
        broken[20..30].fill(f64::NAN);
        assert!(sparkline(&broken, 8).contains(' '));
        assert_eq!(sparkline(&[], 8), "");
        assert_eq!(sparkline(&[1.0, 1.0], 2).chars().count(), 2);
    }
}
