//! Stability margins of a control loop: gain, phase and modulus margin.

use crate::small_signal_controller::SmallSignalController;
use crate::unstable_poles::{about_resonances, growing_poles};
use crate::{DesignError, LinearisedPlant, Responses};
use hydroboom_control::feedback::benchmark::Benchmark;
use hydroboom_description::Description;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// Lowest and highest frequency of the grid \[Hz\], and its initial number of points; resonances of the
/// crane get their own.
const FREQUENCIES: [f64; 2] = [0.02, 300.0];
const POINTS: u32 = 600;
/// Where 1 + L changes by more than this share of itself between two points, the interval is bisected, and
/// the largest number of bisections.
const CHANGE: f64 = 0.3;
const HALVINGS: u32 = 30;
/// Relative width at which a crossover or a least distance counts as found.
const FOUND: f64 = 1e-9;

/// Dynamics of a control loop apart from crane and controller: drive, fieldbus, sampling and position sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation {
    /// Dead time of fieldbus, sampling and drive \[s\].
    pub delay: f64,
    /// Coefficients T_1 \[s\] and T_2 \[s²\] of the drive's lag 1/(T_2 s² + T_1 s + 1).
    pub drive: [f64; 2],
    /// Time constant of the position sensor \[s\].
    pub sensor_lag: f64,
}

impl Actuation {
    /// Dynamics of a machine by its crane file; sampling is half a control period of delay.
    pub fn of(machine: &Description) -> Self {
        let n = &machine.numbers;
        // a bandwidth of zero stands for none
        let lag = |bandwidth: f64| if bandwidth > 0.0 { 1.0 / (TAU * bandwidth) } else { 0.0 };
        let drive = lag(n.drive_bandwidth);
        Self {
            delay: (2.0 * n.fieldbus_delay.round() + 0.5) * n.control_period + n.drive_dead_time,
            drive: [2.0 * n.drive_damping * drive, drive * drive],
            sensor_lag: lag(n.sensor_bandwidth),
        }
    }

    /// From a command to the measured motor speed.
    fn motor_speed(&self, s: Complex<f64>) -> Complex<f64> {
        let [lag, square] = self.drive;
        (-s * self.delay).exp() / (s * s * square + s * lag + 1.0)
    }
}

/// Control loop, opened at the commanded motor speed.
#[derive(Clone, Debug)]
pub enum Loop {
    /// Loop of the benchmark controller: PI and pressure feedback.
    Benchmark {
        /// Benchmark controller.
        controller: Benchmark<f64>,
        /// Time constant of the pressure feedback's high-pass \[s\].
        high_pass: f64,
        /// Drive, fieldbus, sampling and sensors.
        actuation: Actuation,
    },
    /// Loop of the scheduled LQR with its state estimator.
    ScheduledLqr {
        /// Scheduled LQR, linearised at an operating point.
        controller: Box<SmallSignalController>,
        /// Drive, fieldbus, sampling and sensors.
        actuation: Actuation,
    },
}

impl Loop {
    /// Loop of the same controller with drive, fieldbus and sensors of a machine.
    pub fn on(mut self, machine: &Description) -> Self {
        let (Self::Benchmark { actuation, .. } | Self::ScheduledLqr { actuation, .. }) = &mut self;
        *actuation = Actuation::of(machine);
        self
    }

    /// Poles of the controller that grow faster than a rate \[1/s\]; drive, sensors and the published controller,
    /// whose integrator lies at zero, have none.
    pub(crate) fn growing_poles(&self, growth: f64) -> Result<u32, DesignError> {
        match self {
            Self::Benchmark { .. } => Ok(0),
            Self::ScheduledLqr { controller, .. } => controller.growing_poles(growth),
        }
    }

    /// Highest frequency at which it is a response of its own \[Hz\]: half the sampling frequency of a sampled
    /// controller.
    pub(crate) fn highest_frequency(&self) -> f64 {
        match self {
            Self::Benchmark { .. } => f64::INFINITY,
            Self::ScheduledLqr { controller, .. } => 0.5 / controller.period(),
        }
    }

    /// Open-loop gain L(iω) \[1\] at a frequency \[Hz\]; the critical point is −1. NaN at a pole of the scheduled LQR.
    pub fn gain(&self, crane: &Responses, frequency: f64) -> Complex<f64> {
        self.gain_at(crane, Complex::new(0.0, TAU * frequency))
    }

    /// The same for a motor speed that grows as e to the s t, s in \[1/s\].
    pub(crate) fn gain_at(&self, crane: &Responses, s: Complex<f64>) -> Complex<f64> {
        match self {
            Self::Benchmark { controller: c, high_pass, actuation } => {
                let position = (c.proportional + c.integral / s) * c.revolutions_per_metre;
                let high = s * *high_pass / (s * *high_pass + 1.0);
                let pressure = high * (c.pressure_feedback / c.displacement);
                let read = crane.position / (s * actuation.sensor_lag + 1.0);
                (position * read + pressure * crane.pressure) * actuation.motor_speed(s)
            }
            Self::ScheduledLqr { controller, actuation } => {
                let position = crane.position / (s * actuation.sensor_lag + 1.0);
                let readings = [position, crane.pressure, Complex::from(1.0)];
                -controller.frequency_response(readings, s) * actuation.motor_speed(s)
            }
        }
    }
}

/// Stability margins of a control loop. If the loop is unstable, only [`unstable_poles`](Self::unstable_poles) has a
/// meaning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(into = "Shown")]
pub struct Margins {
    /// Gain margin \[1\]: smallest factor above 1 on the loop gain at which the loop becomes unstable; infinite if
    /// there is none.
    pub gain: f64,
    /// Phase margin \[deg\]: smallest distance of the phase from −180° at a loop gain of one; infinite without
    /// crossover.
    pub phase_deg: f64,
    /// Modulus margin \[1\]: smallest distance of L(iω) from −1, the reciprocal of the peak M_s of the sensitivity
    /// function.
    pub modulus_margin: f64,
    /// Frequency of the modulus margin \[Hz\].
    pub at_hz: f64,
    /// Highest gain crossover frequency \[Hz\]; NaN if the loop gain is nowhere one.
    pub crossover_hz: f64,
    /// Number of poles of the closed loop that grow faster than 0.02 1/s, which doubles within 35 s.
    pub unstable_poles: u32,
}

impl Margins {
    /// Whether no pole of the closed loop grows faster than 0.02 1/s.
    pub fn is_stable(&self) -> bool {
        self.unstable_poles == 0
    }
}

/// Margins as they are written: an unstable loop has none, a stable one may have no gain margin, or no crossover.
#[derive(Serialize)]
struct Shown {
    stable: bool,
    unstable_poles: u32,
    gain: Option<f64>,
    phase_deg: Option<f64>,
    modulus_margin: Option<f64>,
    at_hz: Option<f64>,
    crossover_hz: Option<f64>,
}

impl From<Margins> for Shown {
    fn from(m: Margins) -> Self {
        let of = |value: f64| (m.is_stable() && value.is_finite()).then_some(value);
        Self {
            stable: m.is_stable(),
            unstable_poles: m.unstable_poles,
            gain: of(m.gain),
            phase_deg: of(m.phase_deg),
            modulus_margin: of(m.modulus_margin),
            at_hz: of(m.at_hz),
            crossover_hz: of(m.crossover_hz),
        }
    }
}

/// Stability margins of a loop around a linearised crane.
///
/// The frequency grid has points of its own at each resonance of the crane, and is refined where the loop gain
/// changes fast. Crossovers are found by bisection, smallest distances by golden-section search.
///
/// ```
/// use hydroboom_description::Description;
/// use hydroboom_design::{LinearisedPlant, benchmark_loop, margins};
///
/// let description = Description::uia_single_boom()?;
/// let crane = LinearisedPlant::new(&description, 0.25)?;
/// // the paper's gains are stable around the paper's crane
/// let found = margins(&crane, &benchmark_loop(&description))?;
/// assert!(found.is_stable() && found.gain > 1.0 && found.phase_deg > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`DesignError::NoMode`] if the crane's responses or the loop's gain are not finite, or if the turns of the loop do
/// not count its poles. [`DesignError::Eigenvalues`] if the controller's poles cannot be computed.
pub fn margins(crane: &LinearisedPlant, around: &Loop) -> Result<Margins, DesignError> {
    let at = |frequency: f64| {
        let gain = around.gain(&crane.responses(frequency)?, frequency);
        match gain.is_finite() {
            true => Ok(gain),
            false => Err(crane.none("the loop's gain is not finite")),
        }
    };
    let points = sampled(&at, frequencies(crane))?;
    let [low, _] = FREQUENCIES;
    let mut found = Margins {
        gain: f64::INFINITY,
        phase_deg: f64::INFINITY,
        modulus_margin: f64::INFINITY,
        at_hz: low,
        crossover_hz: f64::NAN,
        unstable_poles: growing_poles(crane, around)?.closed_loop,
    };
    let distance = |gain: Complex<f64>| (gain + 1.0).norm();
    for (frequency, gain) in &points {
        if distance(*gain) < found.modulus_margin {
            (found.modulus_margin, found.at_hz) = (distance(*gain), *frequency);
        }
    }
    for three in points.windows(3) {
        let [before, middle, after] = [0, 1, 2].map(|k| three[k]);
        let is_least = distance(middle.1) <= distance(before.1).min(distance(after.1));
        if is_least && distance(middle.1) < 2.0 * found.modulus_margin {
            let of = |frequency: f64| Ok::<_, DesignError>(distance(at(frequency)?));
            let tolerance = FOUND.sqrt() * (after.0 - before.0);
            let (frequency, least) = minimum(of, [before.0, after.0], tolerance)?;
            if least < found.modulus_margin {
                (found.modulus_margin, found.at_hz) = (least, frequency);
            }
        }
    }
    for two in points.windows(2) {
        let [last, now] = [0, 1].map(|k| two[k]);
        let beyond_one = |gain: Complex<f64>| gain.norm() - 1.0;
        if beyond_one(last.1) * beyond_one(now.1) <= 0.0 {
            let (frequency, gain) = crossover(&at, beyond_one, last, now.0)?;
            let left = 180.0 - gain.arg().to_degrees().abs();
            found.phase_deg = found.phase_deg.min(left);
            found.crossover_hz = frequency;
        }
        let imaginary = |gain: Complex<f64>| gain.im;
        if last.1.im * now.1.im <= 0.0 && last.1.re.min(now.1.re) < 0.0 {
            let (_, gain) = crossover(&at, imaginary, last, now.0)?;
            // across the negative axis, nearer to zero than −1
            if (-1.0..0.0).contains(&gain.re) {
                found.gain = found.gain.min(-1.0 / gain.re);
            }
        }
    }
    Ok(found)
}

/// A frequency \[Hz\] and the loop's gain there.
type Point = (f64, Complex<f64>);

/// Frequencies to begin with \[Hz\], in their order.
fn frequencies(crane: &LinearisedPlant) -> Vec<f64> {
    let [low, high] = FREQUENCIES;
    let even = (0..=POINTS).map(|k| low * (high / low).powf(f64::from(k) / f64::from(POINTS)));
    let mut all: Vec<f64> = even.chain(about_resonances(crane, 0.0)).collect();
    all.retain(|frequency| (low..=high).contains(frequency));
    all.sort_unstable_by(f64::total_cmp);
    all.dedup();
    all
}

/// The loop at these frequencies, and between them where it changes fast.
fn sampled(
    at: &impl Fn(f64) -> Result<Complex<f64>, DesignError>,
    frequencies: Vec<f64>,
) -> Result<Vec<Point>, DesignError> {
    let mut points: Vec<Point> = Vec::with_capacity(2 * frequencies.len());
    for frequency in frequencies {
        // limits to be reached, nearest last
        let mut ahead: Vec<(Point, u32)> = vec![((frequency, at(frequency)?), HALVINGS)];
        while let Some((to, halvings)) = ahead.pop() {
            let Some(from) = points.last().copied() else {
                points.push(to);
                continue;
            };
            let size = (from.1 + 1.0).norm().min((to.1 + 1.0).norm());
            if (to.1 - from.1).norm() > CHANGE * size && halvings > 0 {
                let middle = 0.5 * (from.0 + to.0);
                ahead.push((to, halvings - 1));
                ahead.push(((middle, at(middle)?), halvings - 1));
            } else {
                points.push(to);
            }
        }
    }
    Ok(points)
}

/// Where `of` the loop's gain is zero between a point and a frequency at which it has the other sign, by bisection.
fn crossover(
    at: &impl Fn(f64) -> Result<Complex<f64>, DesignError>,
    of: impl Fn(Complex<f64>) -> f64,
    mut from: Point,
    mut to: f64,
) -> Result<Point, DesignError> {
    while to - from.0 > FOUND * to {
        let middle = 0.5 * (from.0 + to);
        let gain = at(middle)?;
        if of(from.1) * of(gain) > 0.0 { from = (middle, gain) } else { to = middle }
    }
    Ok((to, at(to)?))
}

/// Place and value of the minimum of a function between two places, by golden-section search, to a tolerance of the
/// place.
pub(crate) fn minimum<E>(
    mut of: impl FnMut(f64) -> Result<f64, E>,
    [mut low, mut high]: [f64; 2],
    tolerance: f64,
) -> Result<(f64, f64), E> {
    // J. Kiefer, Sequential minimax search for a maximum, Proc. AMS 4(3), 1953
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_left, mut at_right) = (of(left)?, of(right)?);
    while high - low > tolerance {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - golden * (high - low);
            at_left = of(left)?;
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + golden * (high - low);
            at_right = of(right)?;
        }
    }
    Ok(if at_left < at_right { (left, at_left) } else { (right, at_right) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// ω²/(s² + 2 ζ ω s + ω²) of the motor's speed, integrated so many times, as position and as velocity, with no
    /// pressure.
    fn resonant(omega: f64, zeta: f64, is_integrated: bool) -> LinearisedPlant {
        let order = if is_integrated { 3 } else { 2 };
        let mut a = DMatrix::zeros(order, order);
        (a[(0, 1)], a[(1, 0)], a[(1, 1)]) = (1.0, -omega * omega, -2.0 * zeta * omega);
        if is_integrated {
            a[(2, 0)] = 1.0;
        }
        let mut b = DMatrix::zeros(order, 1);
        b[(1, 0)] = omega * omega;
        let mut position = vec![0.0; order];
        position[order - 1 - usize::from(!is_integrated)] = 1.0;
        LinearisedPlant::of(0.1, a, b, [position, vec![0.0; order], vec![0.0; order]]).unwrap()
    }

    /// A proportional loop of a gain.
    fn proportional(gain: f64) -> Loop {
        let paper = Description::uia_single_boom().unwrap();
        let controller = Benchmark {
            proportional: gain,
            integral: 0.0,
            pressure_feedback: 0.0,
            revolutions_per_metre: 1.0,
            ..paper.benchmark()
        };
        let actuation = Actuation { delay: 0.0, drive: [0.0; 2], sensor_lag: 0.0 };
        Loop::Benchmark { controller, high_pass: 1.0, actuation }
    }

    /// Closed form for K ω²/(s² + 2 ζ ω s + ω²), with u = (w/ω)². The gain |L| is 1 where (1 − u)² + 4
    /// ζ² u = K². The distance |1 + L| is least where v = 1 − u solves v² + K v = 2 ζ² (2 + K). For ζ =
    /// 0.001 the resonance is ten times narrower than the spacing of an even grid.
    #[test]
    fn margins_at_a_lightly_damped_resonance_are_those_of_the_closed_form() {
        for (hz, zeta, k) in [(3.317, 1e-3, 0.01), (11.03, 1e-3, 0.004), (40.7, 1e-4, 0.02)] {
            let omega = TAU * hz;
            let found = margins(&resonant(omega, zeta, false), &proportional(k)).unwrap();
            let square = 1.0 - 2.0 * zeta * zeta;
            let u = square + (square * square - 1.0 + k * k).sqrt();
            let phase = (2.0 * zeta * u.sqrt()).atan2(u - 1.0).to_degrees();
            assert!((found.phase_deg / phase - 1.0).abs() < 1e-5, "{found:?}, {phase} deg");
            assert!((found.crossover_hz / (hz * u.sqrt()) - 1.0).abs() < 1e-8, "{found:?}");
            let v = -0.5 * (k + (k * k + 8.0 * zeta * zeta * (2.0 + k)).sqrt());
            let part = 4.0 * zeta * zeta * (1.0 - v);
            let least = (((k + v).powi(2) + part) / (v * v + part)).sqrt();
            assert!((found.modulus_margin / least - 1.0).abs() < 1e-5, "{found:?}, {least}");
            assert!(found.is_stable() && found.gain.is_infinite(), "{found:?}");
        }
    }

    /// A loop whose gain is below one at all frequencies has no crossover. Its phase margin is absent,
    /// and null in JSON; its distance from −1 remains.
    #[test]
    fn a_loop_without_crossover_has_no_phase_margin() {
        let (zeta, k) = (0.5, 0.1);
        let found = margins(&resonant(TAU * 5.0, zeta, false), &proportional(k)).unwrap();
        assert!(found.is_stable() && found.phase_deg.is_infinite(), "{found:?}");
        assert!(found.gain.is_infinite() && found.crossover_hz.is_nan(), "{found:?}");
        let largest = k / (2.0 * zeta * (1.0 - zeta * zeta).sqrt());
        assert!((1.0 - largest..1.0).contains(&found.modulus_margin), "{found:?}");
        let json = serde_json::to_value(found).unwrap();
        for key in ["gain", "phase_deg", "crossover_hz"] {
            assert!(json[key].is_null(), "{json}");
        }
        assert_eq!(json["stable"], true);
        assert!(json["modulus_margin"].is_number() && json["at_hz"].is_number(), "{json}");
        // of an unstable loop, nothing is a margin
        let unstable = serde_json::to_value(Margins { unstable_poles: 2, ..found }).unwrap();
        assert!(unstable["modulus_margin"].is_null() && unstable["at_hz"].is_null(), "{unstable}");
    }

    /// K ω²/(s (s² + 2 ζ ω s + ω²)) crosses the negative real axis at ω, at −K/(2 ζ ω). The gain margin
    /// is the reciprocal of that magnitude; at a higher gain the loop is unstable.
    #[test]
    fn the_gain_margin_at_a_lightly_damped_resonance_is_where_the_loop_becomes_unstable() {
        let (omega, zeta) = (TAU * 7.77, 1e-3);
        let of = |k: f64| margins(&resonant(omega, zeta, true), &proportional(k)).unwrap();
        let limit = 2.0 * zeta * omega;
        let found = of(0.5 * limit);
        assert!(found.is_stable() && (found.gain / 2.0 - 1.0).abs() < 1e-6, "{found:?}");
        assert!((found.modulus_margin / 0.5 - 1.0).abs() < 1e-2, "{found:?}");
        // faster than the growth limit of 0.02 1/s
        assert_eq!(of(2.0 * limit).unstable_poles, 2);
    }
}
