//! The load over the ranges of a crane file, against pressure limit, transducers and motor.

use super::rest_remarks::{bulk_modulus_share, holding_torque};
use hydroboom_description::Description;
use hydroboom_design::LoadPressure;

/// Remarks on limits that the load reaches within the file's ranges: `supervision.pressure_bar`,
/// `sensors.pressure_span_bar` and `drive.max_torque_nm`. The largest pressure at rest \[Pa\] with the file's own
/// values tells whether the motor lifts that load, which is a remark of its own.
///
/// Typical transducers stand in where the file states none, as in the virtual crane.
pub fn load_range_remarks(
    description: &Description,
    load: &LoadPressure,
    largest_at_rest: f64,
) -> Vec<String> {
    let n = &description.numbers;
    let bar = |pressure: f64| pressure * 1e-5;
    let span = description.virtual_crane().0.numbers.pressure_span;
    let mut remarks = Vec::new();
    if load.most > n.supervision_pressure {
        remarks.push(format!(
            "supervision.pressure_bar = {:.1} stops the machine: the heaviest load of the file's ranges takes {:.1} \
             bar at rest. The limit has to be above that and the peaks of the motion",
            bar(n.supervision_pressure),
            bar(load.most)
        ));
    }
    if span < n.supervision_pressure {
        remarks.push(format!(
            "sensors.pressure_span_bar = {:.1} is less than supervision.pressure_bar = {:.1}: a transducer beyond its \
             span reads a constant pressure, which stops the machine with sensor-stuck. The span has to be {:.0} bar \
             or more",
            bar(span),
            bar(n.supervision_pressure),
            bar(n.supervision_pressure)
        ));
    }
    let lifts = |pressure: f64| holding_torque(description, pressure) <= n.drive_torque;
    if lifts(largest_at_rest) && !lifts(load.most) {
        remarks.push(format!(
            "drive.max_torque_nm = {:.1} does not lift the heaviest load of the file's ranges: {:.1} bar at rest take \
             {:.1} N m",
            n.drive_torque,
            bar(load.most),
            holding_torque(description, load.most)
        ));
    }
    remarks
}

/// Load pressure over the file's ranges, and whether the oil is soft at its least.
pub fn load_range_text(description: &Description, load: &LoadPressure) -> String {
    let [least, most] = [load.least, load.most].map(|pressure| pressure * 1e-5);
    let mut text = format!(
        "Load pressure over the file's ranges of payload, friction and rod side: {least:.1} to {most:.1} bar \
         (`hydroboom supervision`)."
    );
    if let Some(share) = bulk_modulus_share(description, load.least) {
        text += &format!(
            " At {least:.1} bar the oil is soft: its bulk modulus is {:.0} % of the largest. Gains for so little load \
             have to be lower.",
            share * 100.0
        );
    }
    text
}
