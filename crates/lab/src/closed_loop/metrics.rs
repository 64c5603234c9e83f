//! Metrics of a course: tracking error, effort, vibration.

use crate::closed_loop::motor_ripple::MotorRipple;
use crate::closed_loop::sample::Sample;
use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_control::supervision::oscillation_detector::{OscillationDetector, OscillationState};
use serde::Serialize;
use std::fmt;

/// Time constant that separates slow deflection of the tip from vibration \[s\]; the boom's modes are at
/// some Hz.
const SLOW: f64 = 0.5;

/// Definition of motor energy, as a sentence below a table.
pub const MOTOR_ENERGY: &str = "\
Motor energy: the positive part of the motor's shaft power (torque times speed), integrated over the whole course, rests included; what flows back is not credited.";

/// Control effort of a course and the vibration of the boom's tip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Effort {
    /// Largest magnitude of the true motor speed \[rpm\].
    pub motor_speed_rpm: f64,
    /// Motor energy \[kJ\]: positive part of the motor's shaft power, torque times speed, integrated over the whole
    /// course, rests included. Recovered energy is not credited.
    pub energy_kj: f64,
    /// Largest distance of the tip from the straight continuation of the first segment \[mm\].
    pub tip_deflection_mm: f64,
    /// RMS vibration of the tip's deflection, without its slow part, while the reference is at rest \[mm\], from the
    /// first motion on. Zero if the reference does not rest after a motion.
    pub residual_vibration_mm: f64,
    /// Motor ripple at rest \[rpm\], an effect of noise and friction: standard deviation of the commanded motor speed
    /// within windows of 1 s. Counted is the time in which the reference has rested for at least 1 s, no load changed
    /// within 1 s, and no motion begins within 0.5 s. The last condition is for controllers with preview.
    ///
    /// Windows follow each other from the first second of a rest on; before a load change and at the end of the course
    /// the last one may be shorter. Each has its own mean, and their squares are pooled. NaN if the course has no such
    /// rest.
    pub motor_ripple_rpm: f64,
    /// RMS rate of change of the true motor speed over the whole course, rests included \[rpm/s\].
    pub motor_slew_rpm_per_s: f64,
    /// Number of control periods in which a predictive controller found no solution and repeated an earlier command.
    pub periods_without_solution: u64,
}

impl Effort {
    /// Note on control periods without a solution; empty if there are none.
    pub fn without_solution(&self) -> String {
        match self.periods_without_solution {
            0 => String::new(),
            count => format!("no command computed in {count} periods: the last plan was held"),
        }
    }

    /// Values of a course that was not completed: all NaN.
    pub const UNFINISHED: Self = Self {
        motor_speed_rpm: f64::NAN,
        energy_kj: f64::NAN,
        tip_deflection_mm: f64::NAN,
        residual_vibration_mm: f64::NAN,
        motor_ripple_rpm: f64::NAN,
        motor_slew_rpm_per_s: f64::NAN,
        periods_without_solution: 0,
    };
}

/// Sustained oscillation of the piston about its resting reference, as found by the oscillation detector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SustainedOscillation {
    /// Amplitude \[mm\]: half the distance between two turning points.
    pub amplitude_mm: f64,
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Whether the motor reached its largest speed or slew rate: then these limits determine the amplitude
    /// (limit cycle).
    pub motor_at_limit: bool,
}

/// Share of a motor limit \[-\] from which the limit counts as reached; below 1 because of rounding, an estimate.
pub const REACHED: f64 = 0.999;

impl SustainedOscillation {
    /// Sustained oscillation after a further period of `elapsed` \[s\] with the control error `error` \[m\]; none
    /// while the oscillation detector has found none. `state` is the detector's, `rests` whether the reference is at
    /// rest.
    pub fn after(
        state: &mut OscillationState<f64>,
        error: f64,
        rests: bool,
        elapsed: f64,
    ) -> Option<Self> {
        let detector = OscillationDetector::POSITIONING;
        let is_found = detector.update(state, error, rests, elapsed);
        let [amplitude, frequency_hz] = detector.amplitude_and_frequency(state);
        is_found.then_some(Self {
            amplitude_mm: 1e3 * amplitude,
            frequency_hz,
            motor_at_limit: false,
        })
    }
}

impl fmt::Display for SustainedOscillation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} mm at {:.2} Hz", self.amplitude_mm, self.frequency_hz)?;
        match self.motor_at_limit {
            true => f.write_str(" with the motor at its limit of speed or slew rate"),
            false => Ok(()),
        }
    }
}

/// Tracking errors x − x_ref of a course, rests included: true, and as measured with sensor noise and
/// fieldbus delay.
///
/// With ideal sensors and fieldbus both are equal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrackingError {
    /// RMS of the true error \[mm\].
    pub rms_true_mm: f64,
    /// RMS of the measured error \[mm\].
    pub rms_measured_mm: f64,
    /// True error of largest magnitude, with its sign \[mm\].
    pub peak_true_mm: f64,
    /// Measured error of largest magnitude, with its sign \[mm\].
    pub peak_measured_mm: f64,
}

impl TrackingError {
    /// Column headings of the four errors, in the order of [`cells`](Self::cells).
    pub const HEADS: [&'static str; 4] =
        ["RMS true [mm]", "RMS measured [mm]", "peak true [mm]", "peak measured [mm]"];

    /// Values of a course that was not completed: all NaN.
    pub const UNFINISHED: Self = Self {
        rms_true_mm: f64::NAN,
        rms_measured_mm: f64::NAN,
        peak_true_mm: f64::NAN,
        peak_measured_mm: f64::NAN,
    };

    /// All four errors \[mm\] in the order of [`HEADS`](Self::HEADS).
    pub fn cells(&self) -> [f64; 4] {
        [self.rms_true_mm, self.rms_measured_mm, self.peak_true_mm, self.peak_measured_mm]
    }

    /// Whether measured and true errors are equal, as with ideal sensors.
    pub fn is_measured_truly(&self) -> bool {
        self.rms_true_mm == self.rms_measured_mm && self.peak_true_mm == self.peak_measured_mm
    }
}

impl Default for TrackingError {
    fn default() -> Self {
        Self::UNFINISHED
    }
}

/// Tracking errors, effort and oscillation of a course, accumulated over its control periods.
#[derive(Clone, Copy, Debug, Default)]
pub struct Metrics {
    square: f64,
    peak: f64,
    /// The same for the true piston position.
    true_square: f64,
    true_peak: f64,
    count: u64,
    /// Detector of sustained oscillation, applied to the true position.
    oscillation: OscillationState<f64>,
    /// Largest oscillation found.
    found: Option<SustainedOscillation>,
    /// Previous command \[rev/s\], and largest magnitude and rate \[rev/s²\] of the command in half-cycles
    /// that did not decay.
    commanded: f64,
    largest_command: f64,
    largest_slew: f64,
    /// Time of the last sample \[s\].
    time: f64,
    effort: Effort,
    /// Time and slow part of the tip's deflection at the previous sample; none before the first.
    before: Option<(f64, f64)>,
    has_moved: bool,
    /// Motor speed at the previous sample \[rpm\], and the integral of its squared rate so far \[rpm²/s\].
    turned: Option<f64>,
    slew_square: f64,
    vibration: f64,
    resting: u64,
    ripple: MotorRipple,
}

impl Metrics {
    /// Metrics before the first control period.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a control period. Its time must not be before that of the previous one.
    pub fn add(&mut self, sample: &Sample) {
        let error = sample.error();
        self.square += error * error;
        self.count += 1;
        if error.abs() > self.peak.abs() {
            self.peak = error;
        }
        let error = sample.true_error();
        self.true_square += error * error;
        if error.abs() > self.true_peak.abs() {
            self.true_peak = error;
        }
        self.add_effort(sample);
        self.ripple.add(sample);
        let off = sample.reference.position - sample.truth.outputs.stroke;
        let rests = sample.reference.velocity == 0.0;
        let passed = sample.time - self.time;
        self.time = sample.time;
        if passed > 0.0 {
            let command = sample.command.motor_speed;
            let slew = (command - self.commanded) / passed;
            self.commanded = command;
            if self.may_oscillate() && rests {
                self.largest_command = self.largest_command.max(command.abs());
                self.largest_slew = self.largest_slew.max(slew.abs());
            }
            let found = SustainedOscillation::after(&mut self.oscillation, off, rests, passed);
            if let Some(now) = found {
                let is_larger =
                    self.found.is_none_or(|before| now.amplitude_mm > before.amplitude_mm);
                self.found = if is_larger { Some(now) } else { self.found };
            }
        }
    }

    fn add_effort(&mut self, sample: &Sample) {
        let truth = &sample.truth;
        let deflection = truth.outputs.tip_deflection;
        let (then, slow) = self.before.unwrap_or((sample.time, deflection));
        let passed = sample.time - then;
        let slow = slow + (deflection - slow) * (passed / SLOW).min(1.0);
        self.before = Some((sample.time, slow));
        let power = truth.motor_torque * truth.motor_speed * std::f64::consts::TAU;
        let effort = &mut self.effort;
        effort.motor_speed_rpm = effort.motor_speed_rpm.max(60.0 * truth.motor_speed.abs());
        effort.energy_kj += 1e-3 * power.max(0.0) * passed;
        let speed = 60.0 * truth.motor_speed;
        let turned = self.turned.replace(speed).unwrap_or(speed);
        if passed > 0.0 {
            self.slew_square += (speed - turned) * (speed - turned) / passed;
        }
        effort.periods_without_solution = sample.periods_without_solution;
        effort.tip_deflection_mm = effort.tip_deflection_mm.max(1e3 * deflection.abs());
        self.has_moved |= sample.reference.velocity != 0.0;
        if self.has_moved && sample.reference.velocity == 0.0 {
            self.vibration += (deflection - slow) * (deflection - slow);
            self.resting += 1;
        }
    }

    /// Effort and vibration of the control periods so far.
    pub fn effort(&self) -> Effort {
        let vibration = (self.vibration / self.resting.max(1) as f64).sqrt();
        Effort {
            residual_vibration_mm: 1e3 * vibration,
            motor_ripple_rpm: self.ripple.deviation(),
            motor_slew_rpm_per_s: (self.slew_square / self.time.max(f64::MIN_POSITIVE)).sqrt(),
            ..self.effort
        }
    }

    /// RMS and peak of the tracking error so far, true and measured \[mm\].
    pub fn tracking_error(&self) -> TrackingError {
        TrackingError {
            rms_true_mm: self.true_rms() * 1e3,
            rms_measured_mm: self.rms() * 1e3,
            peak_true_mm: self.true_peak() * 1e3,
            peak_measured_mm: self.peak() * 1e3,
        }
    }

    /// RMS of the true tracking error \[m\], without sensor noise and fieldbus delay; zero before the first period.
    pub fn true_rms(&self) -> f64 {
        (self.true_square / self.count.max(1) as f64).sqrt()
    }

    /// True error of largest magnitude, with its sign \[m\]; zero before the first period.
    pub fn true_peak(&self) -> f64 {
        self.true_peak
    }

    /// RMS of the measured tracking error \[m\]; zero before the first period.
    pub fn rms(&self) -> f64 {
        (self.square / self.count.max(1) as f64).sqrt()
    }

    /// Measured error of largest magnitude, with its sign \[m\]; zero before the first period.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Whether the last half-cycles of the error at rest did not decay: a sustained oscillation may have begun.
    pub fn may_oscillate(&self) -> bool {
        self.oscillation.half_cycles > 0.5
    }

    /// Whether the detector found a sustained oscillation while the reference rested.
    pub fn oscillates(&self) -> bool {
        self.found.is_some()
    }

    /// Largest sustained oscillation that the detector found while the reference rested, for a motor with these limits
    /// of speed \[rev/s\] and slew rate \[rev/s²\]; none without one.
    pub fn sustained_oscillation(
        &self,
        limits: &ActuatorLimits<f64>,
    ) -> Option<SustainedOscillation> {
        let motor_at_limit = self.largest_command >= REACHED * limits.speed
            || self.largest_slew >= REACHED * limits.slew;
        self.found.map(|found| SustainedOscillation { motor_at_limit, ..found })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use hydroboom_control::command::AxisCommand;
    use hydroboom_control::reference::profile::SetPoint;
    use hydroboom_description::Description;
    use hydroboom_virtual_crane::VirtualCrane;

    /// Metrics of a course of three seconds with the given position error \[m\].
    pub(crate) fn metrics(off: impl Fn(f64) -> f64) -> Metrics {
        commanded(off, |_| 0.0)
    }

    const LIMITS: ActuatorLimits<f64> = ActuatorLimits { speed: 50.0, slew: 500.0 };

    /// An oscillation whose command reaches the motor's limits, of speed or slew rate, is distinguished
    /// from one within them.
    #[test]
    fn an_oscillation_with_the_motor_at_its_limit_is_distinguished() {
        let swing = |time: f64| 3e-3 * (8.0 * time).sin();
        // a fast turn before the oscillation does not belong to it
        let first = |time: f64| if time < 0.01 { 50.0 } else { 0.0 };
        for (size, omega, is_at_limit) in
            [(20.0, 8.0, false), (50.0, 8.0, true), (20.0, 40.0, true)]
        {
            let command = |time: f64| first(time) + size * (omega * time).sin();
            let found = commanded(swing, command).sustained_oscillation(&LIMITS).unwrap();
            assert_eq!(found.motor_at_limit, is_at_limit, "{size} rev/s at {omega} rad/s");
            assert_eq!(found.to_string().contains("motor at its limit"), is_at_limit, "{found}");
        }
    }

    /// The same with commands \[rev/s\].
    fn commanded(off: impl Fn(f64) -> f64, command: impl Fn(f64) -> f64) -> Metrics {
        let description = Description::uia_virtual().unwrap();
        let crane = VirtualCrane::new(&description, &description.start(0.25)).unwrap();
        let (signals, mut truth) = (crane.signals(), crane.truth());
        let mut metrics = Metrics::new();
        for k in 0..=3000 {
            let time = 1e-3 * f64::from(k);
            truth.outputs.stroke = 0.25 + off(time);
            let reference = SetPoint { position: 0.25, velocity: 0.0 };
            let command = AxisCommand { motor_speed: command(time), holding_valve: 1.0 };
            let load_changed = false;
            metrics.add(&Sample {
                time,
                reference,
                signals,
                load_changed,
                truth,
                command,
                periods_without_solution: 0,
            });
        }
        metrics
    }

    #[test]
    fn a_sustained_oscillation_is_distinguished_from_a_decaying_one() {
        let swing = |time: f64| 3e-3 * (12.0 * time).sin();
        let oscillates = |off: &dyn Fn(f64) -> f64| metrics(off).oscillates();
        assert!(oscillates(&swing));
        let found = metrics(swing).sustained_oscillation(&LIMITS).unwrap();
        assert!((found.amplitude_mm - 3.0).abs() < 0.1, "{found}");
        assert!((found.frequency_hz - 12.0 / std::f64::consts::TAU).abs() < 0.1, "{found}");
        assert!(!oscillates(&|time| swing(time) * (-0.5 * time).exp()));
        assert!(!oscillates(&|time| 0.1 * swing(time)));
        // an error held by friction that the controller reduces at 4 mm/s is no oscillation
        assert!(!oscillates(&|time| -9e-3 + 4e-3 * (time - 1.0).max(0.0)));
        // the first half-cycles may be the beginning of one
        let late = |time: f64| if time > 2.0 { swing(time) } else { 0.0 };
        assert!(metrics(late).may_oscillate() && !metrics(late).oscillates());
    }
}
