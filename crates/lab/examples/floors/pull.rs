//! What a load that changes leaves of the error whoever controls. A crane is led by the scheduled LQR up to the change; from that very instant, as if
//! it had been known, the motor is told all its speed against the pull, and as soon as the piston is home it counts as being there at rest
//! for the rest of the course. Nothing that turns this motor has less: oil that is delivered moves a mass on an oil spring that way, and not the other
//! way before a full swing is over, however the oil stiffens; so more of it leaves less of the pull until the piston is home.
//!
//! Or told so not before the change shows: in what is read of the piston or of the load pressure, beside the same crane without the change, by more than noise
//! makes of them. Or told so, and in time all its speed the other way, so that the piston is at rest when it is home.

use super::{Case, Failure, Left};
use hydroboom_control::command::AxisCommand;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_virtual_crane::VirtualCrane;

/// A piston that was never pulled so far is home \[m\].
const PULLED: f64 = 1e-3;
/// It is over by then \[s\].
const LONGEST: f64 = 2.0;
/// What is read is more than noise beyond so many of its standard deviations: one in a hundred thousand is, and there are a thousand in a second.
const SHOWS: f64 = 4.3;

/// When whoever controls knows of a change.
#[derive(Clone, Copy, PartialEq)]
pub enum Knows {
    /// From the very instant.
    AtOnce,
    /// From when it shows.
    OnceItShows,
}

/// How a piston is when it is home.
#[derive(Clone, Copy, PartialEq)]
pub enum Home {
    /// At rest from then on, however fast it came.
    Stopped,
    /// At rest by its motor.
    Braked,
}

/// Whether what is read of a crane is another than of its twin by more than noise, which is the same for both.
fn shows(crane: &Description, machine: &VirtualCrane, twin: &VirtualCrane) -> bool {
    let n = &crane.numbers;
    let [here, there] = [machine, twin].map(VirtualCrane::signals);
    let rod_side: f64 = crane.cylinder().area_ratio();
    let load_pressure = n.pressure_noise * n.pressure_span * (1.0 + rod_side * rod_side).sqrt();
    (here.stroke - there.stroke).abs() > SHOWS * n.position_noise
        || (here.load_pressure(rod_side) - there.load_pressure(rod_side)).abs()
            > SHOWS * load_pressure
}

/// A crane whose load has changed, and what it is told in each period from then on.
struct Pull {
    machine: VirtualCrane,
    periods: Vec<(SetPoint<f64>, AxisCommand<f64>)>,
    /// Where the piston was off before \[m\].
    begins: f64,
    /// Motor speed against the pull \[rev/s\].
    against: f64,
    /// So many periods after the change it is known.
    known: usize,
}

/// How a pull ended.
#[derive(Clone, Copy)]
struct Pulled {
    /// Sum of squares \[m²\] over the samples in which the piston was pulled off.
    square: f64,
    /// How far it was \[m\].
    farthest: f64,
    /// Whether it was home before it was at rest again.
    home: bool,
}

impl Pull {
    /// By the change of the given number, of a crane led until then as in the run, and then with a motor that turns so fast \[rev/s\].
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

    /// With all of the motor against it, and the other way from the given period on, until the piston is home or at rest on its way there.
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

    /// Braked as late as it may be, or not at all.
    fn ends(&self, home: Home) -> Result<Pulled, Failure> {
        let unbraked = self.braked_from(usize::MAX)?;
        if home == Home::Stopped || unbraked.farthest <= PULLED {
            return Ok(unbraked);
        }
        // the earliest that does not leave it at rest before it is home: it passes by less than it moves in a period
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

/// What the changes of a course leave at best, with a motor that turns no faster than this \[rev/s\].
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
