//! Delay of a machine's motor speed from command to measurement: drive and fieldbus.

use hydroboom_description::Description;
use hydroboom_virtual_crane::fieldbus_delay;
use std::f64::consts::TAU;

/// Delay due to the lag of the drive, 2ζ/ω \[s\]; zero for an ideal motor.
fn lag(model: &Description) -> f64 {
    let n = &model.numbers;
    if n.drive_bandwidth > 0.0 { 2.0 * n.drive_damping / (TAU * n.drive_bandwidth) } else { 0.0 }
}

/// Delay of the drive alone \[s\]: dead time and lag.
fn drive_delay(model: &Description) -> f64 {
    model.numbers.drive_dead_time + lag(model)
}

/// Delay from command to measurement \[s\].
pub(crate) fn total_delay(model: &Description) -> f64 {
    drive_delay(model) + fieldbus_delay(model)
}

/// Model with a drive: the crane file's or, if it describes none, the delay assumed by the state estimator
/// as dead time.
pub(crate) fn with_drive(model: &Description) -> Description {
    match drive_delay(model) > 0.0 {
        true => model.clone(),
        false => with_drive_delay(model, model.numbers.tuning.estimator_drive_lag),
    }
}

/// Model with a total drive delay of `delay` \[s\]. Its lag is kept unless it is longer; the rest is dead
/// time.
pub(crate) fn with_drive_delay(model: &Description, delay: f64) -> Description {
    let mut model = model.clone();
    let lag = lag(&model);
    let n = &mut model.numbers;
    if lag > delay {
        n.drive_bandwidth *= lag / delay;
    }
    n.drive_dead_time = (delay - lag).max(0.0);
    with_estimated_delay(&model)
}

/// Model whose drive has half of its delay as lag if the crane file describes none: start value of the
/// search.
pub(crate) fn with_half_as_lag(model: &Description) -> Description {
    let mut model = model.clone();
    let n = &mut model.numbers;
    if n.drive_bandwidth == 0.0 && n.drive_dead_time > 0.0 {
        n.drive_dead_time *= 0.5;
        n.drive_bandwidth = 2.0 * n.drive_damping / (TAU * n.drive_dead_time);
    }
    model
}

/// Model whose state estimator knows the drive's delay, within the range of its own identification.
pub(crate) fn with_estimated_delay(model: &Description) -> Description {
    let mut changed = model.clone();
    let tuning = &mut changed.numbers.tuning;
    let (low, high) = (tuning.estimator_shortest_drive_lag, tuning.estimator_longest_drive_lag);
    tuning.estimator_drive_lag = drive_delay(model).max(low).min(high);
    changed
}

/// Model whose state estimator attributes the whole delay from command to measurement to the drive: for a
/// loop without a fieldbus.
pub(crate) fn as_one_lag(model: &Description) -> Description {
    let mut changed = model.clone();
    changed.numbers.tuning.estimator_drive_lag = total_delay(model);
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dividing_a_delay_into_lag_and_dead_time_keeps_its_sum() {
        let mut model = Description::uia_single_boom().unwrap();
        let known = model.numbers.tuning.estimator_drive_lag;
        let described = with_drive(&model);
        assert_eq!(described.numbers.drive_dead_time, known);
        assert!((drive_delay(&with_half_as_lag(&described)) - known).abs() < 1e-12);
        assert!((total_delay(&described) - known - fieldbus_delay(&model)).abs() < 1e-12);
        // corresponds to a lag of 8.5 ms
        model.set("drive.bandwidth_hz=30").unwrap();
        for delay in [5e-3, 20e-3] {
            let changed = with_drive_delay(&model, delay);
            assert!((drive_delay(&changed) - delay).abs() < 1e-12);
            assert!((changed.numbers.tuning.estimator_drive_lag - delay).abs() < 1e-12);
        }
        assert!(with_drive_delay(&model, 20e-3).numbers.drive_bandwidth == 30.0);
        assert!(with_drive_delay(&model, 5e-3).numbers.drive_dead_time == 0.0);
    }
}
