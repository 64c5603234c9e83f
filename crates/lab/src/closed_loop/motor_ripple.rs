//! Motor ripple: deviation of the commanded motor speed while the reference is at rest.

use crate::closed_loop::sample::Sample;

/// Time after the end of a motion, or after a load change, from which the motor's ripple counts \[s\].
const SETTLING: f64 = 1.0;
/// Window of the motor's ripple \[s\]. Slower changes, by leakage or an integrator, are not ripple.
const WINDOW: f64 = 1.0;
/// Time before a motion in which a controller with preview may already act \[s\].
const AHEAD: f64 = 0.5;

/// Number of samples, and sum of their squares about a mean \[rpm²\].
type Squares = (u64, f64);

fn both(a: Squares, b: Squares) -> Squares {
    (a.0 + b.0, a.1 + b.1)
}

/// Pooled variance of the commanded motor speed over windows at rest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MotorRipple {
    /// Time since which the reference has rested under the same load \[s\]; none in motion.
    since: Option<f64>,
    /// End of the present window \[s\], with its mean \[rpm\] and squares so far.
    end: f64,
    mean: f64,
    window: Squares,
    /// Previous window, which counts unless a motion begins soon after it.
    before: Squares,
    /// Windows that count.
    counted: Squares,
}

impl MotorRipple {
    /// Adds a control period.
    pub(super) fn add(&mut self, sample: &Sample) {
        let time = sample.time;
        if sample.reference.velocity != 0.0 {
            *self = Self { counted: self.counted, ..Self::default() };
            return;
        }
        let since = self.since.filter(|_| !sample.load_changed).unwrap_or(time);
        if self.since != Some(since) {
            let end = since + SETTLING + WINDOW;
            *self = Self { since: Some(since), end, counted: self.until_now(), ..Self::default() };
        }
        if time - since < SETTLING {
            return;
        }
        if time >= self.end {
            self.before = self.window;
            (self.end, self.mean, self.window) = (self.end + WINDOW, 0.0, (0, 0.0));
        }
        if time >= self.end - WINDOW + AHEAD {
            self.counted = both(self.counted, self.before);
            self.before = (0, 0.0);
        }
        // Welford's recursion
        let speed = 60.0 * sample.command.motor_speed;
        let off = speed - self.mean;
        let count = self.window.0 + 1;
        self.mean += off / count as f64;
        self.window = (count, self.window.1 + off * (speed - self.mean));
    }

    /// Sum of all windows, if no motion follows.
    fn until_now(&self) -> Squares {
        both(self.counted, both(self.before, self.window))
    }

    /// Standard deviation \[rpm\].
    pub(super) fn deviation(&self) -> f64 {
        let (count, square) = self.until_now();
        (square / count as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hydroboom_control::command::AxisCommand;
    use hydroboom_control::reference::profile::SetPoint;
    use hydroboom_description::Description;
    use hydroboom_virtual_crane::VirtualCrane;

    /// In each rest the command is a sine of 3 rpm about a mean of its own, which drifts by 1 rpm per
    /// second in the first rest. During motion it is 1000 rpm higher. So it is in the second after a motion
    /// or a load change, and in the 0.4 s before a motion.
    #[test]
    fn motor_ripple_is_computed_about_the_mean_of_each_settled_rest() {
        let description = Description::uia_virtual().unwrap();
        let crane = VirtualCrane::new(&description, &description.start(0.25)).unwrap();
        let (signals, truth) = (crane.signals(), crane.truth());
        let ripple_until = |end: u32| {
            let mut ripple = MotorRipple::default();
            for k in 0..end {
                let time = 1e-3 * f64::from(k);
                // rests begin at 0, 6 and 10 s, the last one with another load
                let (mean, since) = match k {
                    ..5000 => (20.0 + time, 0),
                    5000..6000 => (1000.0, k),
                    6000..10000 => (50.0, 6000),
                    _ => (-30.0, 10000),
                };
                let unsettled =
                    if k - since < 1000 || (4600..5000).contains(&k) { 1000.0 } else { 0.0 };
                let speed = mean + unsettled + 3.0 * (std::f64::consts::TAU * 20.0 * time).sin();
                let velocity = if (5000..6000).contains(&k) { 0.1 } else { 0.0 };
                ripple.add(&Sample {
                    time,
                    reference: SetPoint { position: 0.25, velocity },
                    signals,
                    load_changed: k == 10000,
                    truth,
                    command: AxisCommand { motor_speed: speed / 60.0, holding_valve: 1.0 },
                    periods_without_solution: 0,
                });
            }
            ripple.deviation()
        };
        let deviation = 3.0 / 2_f64.sqrt();
        for end in [3000, 4500, 6000, 10000, 13000] {
            let ripple = ripple_until(end);
            assert!((ripple - deviation).abs() < 1e-2, "{ripple} rpm by {end} ms");
        }
        assert!(ripple_until(900).is_nan());
    }
}
