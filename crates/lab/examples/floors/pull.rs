//! What a load that changes leaves of the error whoever controls. A crane is steered by model following up to the change; from that very instant, as if
//! it had been known, the motor is told all its speed against the pull, and as soon as the piston is home it counts as being there at rest
//! for the rest of the course. Nothing that turns this motor has less: oil that is delivered moves a mass on an oil spring that way, and not the other
//! way before a full swing is over, however the oil stiffens; so more of it leaves less of the pull until the piston is home.
//!
//! Or told so not before the change shows: in what is read of the piston or of the load pressure, beside the same crane without the change, by more than noise
//! makes of them.

use super::{Case, Failure, Left};
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

/// Whether what is read of a crane is another than of its twin by more than noise, which is the same for both.
fn shows(crane: &Description, machine: &VirtualCrane, twin: &VirtualCrane) -> bool {
    let n = &crane.numbers;
    let [here, there] = [machine, twin].map(VirtualCrane::measured);
    let areas = crane.cylinder();
    let rod_side: f64 = areas.rod_side_area / areas.piston_area;
    let load_pressure = n.pressure_noise * n.pressure_span * (1.0 + rod_side * rod_side).sqrt();
    (here.stroke - there.stroke).abs() > SHOWS * n.position_noise
        || (here.load_pressure - there.load_pressure).abs() > SHOWS * load_pressure
}

/// Sum of squares \[m²\] over the samples in which the piston is pulled off by the change of the given number, and how far it is \[m\]; led until then as in
/// the run, and from then on with a motor that turns so fast \[rev/s\].
fn pull(case: &Case, number: usize, motor_speed: f64, knows: Knows) -> Result<[f64; 2], Failure> {
    let Case { crane, course, following, .. } = case;
    let change = course.loads()[number];
    let mut machine = VirtualCrane::new(crane, &crane.start(course.reference(0.0).position))?;
    let mut loads = course.loads()[..=number].iter().peekable();
    let mut mass = crane.numbers.payload;
    let mut against = 0.0;
    let [mut square, mut farthest, mut begins] = [0.0; 3];
    // goes on without the change
    let mut twin = None;
    for sample in &following.samples {
        let error = sample.reference.position - machine.truth().outputs.stroke;
        while let Some(load) = loads.next_if(|load| load.time <= sample.time) {
            against = if load.mass > mass { 1.0 } else { -1.0 };
            mass = load.mass;
            twin =
                (load.time == change.time && knows == Knows::OnceItShows).then(|| machine.clone());
            machine.set_payload(mass)?;
            (begins, farthest) = (error, 0.0);
        }
        let mut command = sample.command;
        if sample.time >= change.time {
            match &mut twin {
                Some(unchanged) if !shows(crane, &machine, unchanged) => {
                    unchanged.advance(&command)?;
                }
                _ => {
                    twin = None;
                    command.motor_speed = against * motor_speed;
                }
            }
            let pulled: f64 = against * (error - begins);
            let home = farthest > PULLED && pulled <= 0.0;
            if home || sample.time > change.time + LONGEST {
                break;
            }
            farthest = farthest.max(pulled);
            square += pulled.max(0.0).powi(2);
        }
        machine.advance(&command)?;
    }
    Ok([square, farthest])
}

/// What the changes of a course leave at best, with a motor that turns no faster than this \[rev/s\].
pub fn left(case: &Case, motor_speed: f64, knows: Knows) -> Result<Left, Failure> {
    let [mut square, mut farthest] = [0.0, 0.0_f64];
    for number in 0..case.course.loads().len() {
        let [more, far] = pull(case, number, motor_speed, knows)?;
        square += more;
        farthest = farthest.max(far);
    }
    let rms = (square / case.following.samples.len() as f64).sqrt();
    Ok(Left { rms, farthest })
}
