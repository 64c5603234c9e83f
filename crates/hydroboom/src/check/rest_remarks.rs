//! Remarks on a crane at rest.

use hydroboom_description::Description;

/// Share of the largest bulk modulus below which the oil is soft \[-\].
const SOFT_SHARE: f64 = 0.9;

/// Remarks on a crane at rest, by piston position \[m\] and piston-side pressure \[Pa\]: a load beyond the motor's
/// torque, and soft oil at the pressure of the load.
pub fn rest_remarks(description: &Description, pressures: &[(f64, f64)]) -> Vec<String> {
    let n = &description.numbers;
    let oil = description.oil();
    let soft: Vec<String> = pressures
        .iter()
        .map(|(stroke, pressure)| {
            (stroke, pressure, oil.bulk_modulus(*pressure) / n.bulk_modulus_max)
        })
        .filter(|(.., share)| *share < SOFT_SHARE)
        .map(|(stroke, pressure, share)| {
            format!("{:.0} % at {:.0} mm ({:.1} bar)", share * 100.0, stroke * 1e3, pressure * 1e-5)
        })
        .collect();
    let torque = |pressure: f64| pressure * n.displacement / std::f64::consts::TAU;
    let heaviest = pressures.iter().map(|(_, pressure)| *pressure).fold(0.0, f64::max);
    let too_heavy = torque(heaviest) > n.drive_torque;
    let mut remarks: Vec<String> = too_heavy
        .then(|| {
            format!(
                "the motor does not lift the load: {:.1} bar at rest take {:.1} N m, and drive.max_torque_nm = {:.1}",
                heaviest * 1e-5,
                torque(heaviest),
                n.drive_torque
            )
        })
        .into_iter()
        .collect();
    if soft.is_empty() {
        return remarks;
    }
    remarks.push(format!(
        "the load pressure lies in the oil's soft range: its bulk modulus is {} of the largest; oil.transition_bar = {:.1}, \
         oil.transition_width_bar = {:.1}. The load oscillates slowly there, a little air changes its frequency \
         much, and gains have to be lower",
        soft.join(", "),
        n.transition * 1e-5,
        n.transition_width * 1e-5
    ));
    remarks
}
