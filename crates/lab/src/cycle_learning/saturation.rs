//! Effect of the motor's speed and slew-rate limits on a cycle, with time and amount.

use hydroboom_description::Description;
use hydroboom_model::drive::{DeadTime, Drive, DriveState, parts};
use std::f64::consts::TAU;

/// Smallest speed deficit due to the slew-rate limit that is reported, as a share of the largest speed.
/// Measurement noise makes commands step from period to period, which a motor need not follow.
const TOLD: f64 = 0.01;

/// Deficits of commands \[rev/s\], one per period \[s\]: a sentence for each limit reached.
pub(crate) fn saturations(model: &Description, commands: &[f64], period: f64) -> Vec<String> {
    let n = &model.numbers;
    let time = |k: usize| k as f64 * period;
    let mut said = Vec::new();
    let at_limit = |k: &usize| commands[*k].abs() >= n.motor_speed * (1.0 - 1e-9);
    let saturated: Vec<usize> = (0..commands.len()).filter(at_limit).collect();
    if let Some(first) = saturated.first() {
        let most = commands.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
        let beyond = match most > n.motor_speed * (1.0 + 1e-9) {
            true => format!(
                ", and up to {:.0} rpm beyond it are commanded",
                (most - n.motor_speed) * 60.0
            ),
            false => String::new(),
        };
        said.push(format!(
            "the motor's speed is at its limit of {:.0} rpm for {:.3} s, from {:.3} s on{beyond}: no correction \
             can compensate this fully",
            n.motor_speed * 60.0,
            saturated.len() as f64 * period,
            time(*first)
        ));
    }
    let free = speeds(model, commands, period, f64::INFINITY);
    let limited = speeds(model, commands, period, n.motor_slew);
    let lacks = free.iter().zip(&limited).map(|(free, limited)| (free - limited).abs());
    let most = lacks.clone().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((k, lack)) = most.filter(|(_, lack)| *lack > TOLD * n.motor_speed) {
        let count = lacks.filter(|lack| *lack > TOLD * n.motor_speed).count();
        said.push(format!(
            "the motor's slew of {:.0} rpm/s limits it for {:.3} s; at {:.3} s it lacks {:.0} rpm: no correction \
             can compensate this fully",
            n.motor_slew * 60.0,
            count as f64 * period,
            time(k),
            lack * 60.0
        ));
    }
    said
}

/// Motor speeds \[rev/s\] of the drive under commands, with a slew-rate limit \[rev/s²\].
fn speeds(model: &Description, commands: &[f64], period: f64, slew: f64) -> Vec<f64> {
    let n = &model.numbers;
    let dead_time = DeadTime::of(n.drive_dead_time, period);
    // an ideal motor is represented by a lag of one period
    let frequency = if n.drive_bandwidth > 0.0 { TAU * n.drive_bandwidth } else { 1.0 / period };
    let drive = Drive {
        frequency,
        damping: n.drive_damping,
        torque: f64::INFINITY,
        inertia: 1.0,
        largest_speed: n.motor_speed,
        slew,
    };
    let first = commands.first().copied().unwrap_or(0.0);
    let mut state = DriveState::steady(first);
    let of = |k: usize| {
        let sent = |ago: usize| k.checked_sub(ago).map_or(first, |at| commands[at]);
        let (wanted, parts) = (dead_time.arrived(sent), parts(frequency, period));
        drive.advance(&mut state, wanted, 0.0, period, parts, |_, _| {});
        state.speed
    };
    (0..commands.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motor_saturation_is_reported_with_time_and_amount() {
        let mut model = Description::uia_single_boom().unwrap();
        let n = &mut model.numbers;
        (n.motor_speed, n.motor_slew, n.drive_bandwidth) = (40.0, 100.0, 60.0);
        let period = 1e-3;
        let ramp = |slew: f64, most: f64| -> Vec<f64> {
            (0..3000).map(|k| (slew * (f64::from(k) * period - 1.0).max(0.0)).min(most)).collect()
        };
        assert!(saturations(&model, &ramp(90.0, 30.0), period).is_empty());
        let fast = saturations(&model, &ramp(90.0, 45.0), period);
        // a ramp of 90 rev/s² reaches 40 rev/s after 0.444 s and stays above it to the end
        assert!(
            fast.len() == 1 && fast[0].contains("2400 rpm for 1.555 s, from 1.445 s on"),
            "{fast:?}"
        );
        assert!(fast[0].contains("300 rpm beyond it"), "{fast:?}");
        // a ramp of 200 rev/s² reaches 30 rev/s after 0.15 s, when a slew rate of 100 rev/s² has reached
        // half of it
        let steep = saturations(&model, &ramp(200.0, 30.0), period);
        assert!(steep.len() == 1 && steep[0].contains("6000 rpm/s"), "{steep:?}");
        let amount = steep[0].split("lacks ").nth(1).and_then(|rest| rest.split(' ').next());
        let lacks: f64 = amount.unwrap().parse().unwrap();
        assert!((lacks / 60.0 - 15.0).abs() < 1.5, "{steep:?}");
    }
}
