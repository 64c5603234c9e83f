//! Lower bound of the error after a load change, for any controller. The crane runs under the scheduled LQR
//! up to the change. From then on the motor turns at its largest speed against the deviation. As soon as
//! the piston is back at its earlier error, it counts as being at rest there for the remaining course.
//!
//! No other command of this motor gives a smaller error. Delivered oil moves the mass on the oil spring in
//! its own direction for a full oscillation period, whatever the stiffness of the oil. More delivered oil
//! therefore leaves a smaller deviation until the piston is back.
//!
//! Variants: the full speed begins only once the change shows in the measured position or load pressure. It
//! shows when the difference from the same crane without the change exceeds the noise. And: the motor
//! reverses to full speed in time, so that the piston is at rest when it is back.

use super::{Case, Failure, Left};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_virtual_crane::VirtualCrane;

/// Smallest deviation that counts as one \[m\].
const PULLED: f64 = 1e-3;
/// Duration of the computation after the change \[s\].
const LONGEST: f64 = 2.0;
/// Detection threshold in standard deviations of the noise. One sample in a hundred thousand exceeds it by
/// chance, at a thousand samples per second.
const SHOWS: f64 = 4.3;

/// Time from which the controller knows of the load change.
#[derive(Clone, Copy, PartialEq)]
pub enum Knows {
    /// From the moment of the change.
    AtOnce,
    /// From its detection in the measurements.
    OnceItShows,
}

/// State of the piston on its return.
#[derive(Clone, Copy, PartialEq)]
pub enum Home {
    /// At rest from then on, whatever its velocity.
    Stopped,
    /// Brought to rest by the motor.
    Braked,
}

/// Whether the measured position or load pressure differs from that of the crane without the change by more
/// than the noise, which is the same for both.
fn shows(crane: &Description, machine: &VirtualCrane, twin: &VirtualCrane) -> bool {
    let n = &crane.numbers;
    let [here, there] = [machine, twin].map(VirtualCrane::signals);
    let rod_side: f64 = crane.cylinder().area_ratio();
    let load_pressure = n.pressure_noise * n.pressure_span * (1.0 + rod_side * rod_side).sqrt();
    (here.stroke - there.stroke).abs() > SHOWS * n.position_noise
        || (here.load_pressure(rod_side) - there.load_pressure(rod_side)).abs()
            > SHOWS * load_pressure
}

/// Crane with a changed load, and reference and command of each later period.
struct Pull {
    machine: VirtualCrane,
    periods: Vec<(SetPoint<f64>, AxisCommand<f64>)>,
    /// Error before the change \[m\].
    begins: f64,
    /// Motor speed against the deviation \[rev/s\].
    against: f64,
    /// Number of periods after the change from which it is known.
    known: usize,
}

/// Result of a deviation.
#[derive(Clone, Copy)]
struct Pulled {
    /// Sum of the squared deviations \[m²\].
    square: f64,
    /// Largest deviation \[m\].
    farthest: f64,
    /// Whether the piston returned before it came to rest.
    home: bool,
}

impl Pull {
    /// The deviation after load change `number`. Up to it the crane is driven by the commands of the run;
    /// then the motor turns at `motor_speed` \[rev/s\].
    fn by(case: &Case, number: usize, motor_speed: f64, knows: Knows) -> Result<Self, Failure> {
        let Case { crane, course, scheduled, .. } = case;
        let change = &course.loads()[number];
        let mut machine = VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?;
        let mut loads = course.loads()[..number].iter().peekable();
        let mut mass = crane.numbers.payload;
        let mut samples = scheduled.samples.iter();
        for sample in samples.by_ref().take_while(|sample| sample.time < change.time) {
            while let Some(load) = loads.next_if(|load| load.time <= sample.time) {
                mass = load.mass;
                machine.set_payload(mass)?;
            }
            machine.advance(&sample.command)?;
        }
        let begun = scheduled.samples.partition_point(|sample| sample.time < change.time);
        let after = &scheduled.samples[begun..];
        let until = after.partition_point(|sample| sample.time <= change.time + LONGEST);
        let periods: Vec<_> =
            after[..until].iter().map(|sample| (sample.reference, sample.command)).collect();
        let first = periods.first().ok_or("the course ends where its load changes")?;
        let begins = first.0.position - machine.truth().outputs.stroke;
        let mut twin = machine.clone();
        machine.set_payload(change.mass)?;
        let known = match knows {
            Knows::AtOnce => 0,
            Knows::OnceItShows => {
                let mut untold = machine.clone();
                let mut known = 0;
                for (_, command) in &periods {
                    if shows(crane, &untold, &twin) {
                        break;
                    }
                    untold.advance(command)?;
                    twin.advance(command)?;
                    known += 1;
                }
                known
            }
        };
        let against = if change.mass > mass { motor_speed } else { -motor_speed };
        Ok(Self { machine, periods, begins, against, known })
    }

    /// Motor at full speed against the deviation, and in reverse from the given period on, until the piston
    /// returns or comes to rest before it.
    fn braked_from(&self, period: usize) -> Result<Pulled, Failure> {
        let mut machine = self.machine.clone();
        let (mut square, mut farthest) = (0.0, 0.0_f64);
        let mut before = 0.0;
        for (k, (reference, command)) in self.periods.iter().enumerate() {
            let error = reference.position - machine.truth().outputs.stroke;
            let pulled = self.against.signum() * (error - self.begins);
            let was_pulled = farthest > PULLED;
            if was_pulled && pulled <= 0.0 {
                return Ok(Pulled { square, farthest, home: true });
            }
            if was_pulled && k > period && pulled < farthest && pulled >= before {
                return Ok(Pulled { square, farthest, home: false });
            }
            before = pulled;
            farthest = farthest.max(pulled);
            square += pulled.max(0.0).powi(2);
            let mut command = *command;
            if k >= self.known {
                command.motor_speed = if k < period { self.against } else { -self.against };
            }
            machine.advance(&command)?;
        }
        Ok(Pulled { square, farthest, home: farthest <= PULLED })
    }

    /// Result with the latest possible braking, or without braking.
    fn ends(&self, home: Home) -> Result<Pulled, Failure> {
        let unbraked = self.braked_from(usize::MAX)?;
        if home == Home::Stopped || unbraked.farthest <= PULLED {
            return Ok(unbraked);
        }
        // bisection for the earliest reversal with which the piston still returns: it then passes by less
        // than its motion in a period
        let (mut short, mut passes) = (self.known, self.periods.len());
        let mut ends = unbraked;
        while short + 1 < passes {
            let middle = short.midpoint(passes);
            let braked = self.braked_from(middle)?;
            if braked.home {
                (passes, ends) = (middle, braked);
            } else {
                short = middle;
            }
        }
        Ok(ends)
    }
}

/// Lower bound of the error due to the load changes of a course, with the given largest motor speed
/// \[rev/s\].
pub fn left(case: &Case, motor_speed: f64, knows: Knows, home: Home) -> Result<Left, Failure> {
    let [mut square, mut farthest] = [0.0, 0.0_f64];
    for number in 0..case.course.loads().len() {
        let pulled = Pull::by(case, number, motor_speed, knows)?.ends(home)?;
        square += pulled.square;
        farthest = farthest.max(pulled.farthest);
    }
    let rms = (square / case.scheduled.samples.len() as f64).sqrt();
    Ok(Left { rms, farthest })
}
