//! Remarks on a crane at rest.

use hydroboom_description::Description;

/// Share of the largest bulk modulus below which the oil is soft \[-\].
const SOFT_SHARE: f64 = 0.9;

/// Bulk modulus at a gauge pressure \[Pa\] as a share of the largest \[-\], below 0.9, where the oil is soft; none
/// where it is stiff.
pub fn bulk_modulus_share(description: &Description, pressure: f64) -> Option<f64> {
    let share = description.oil().bulk_modulus(pressure) / description.numbers.bulk_modulus_max;
    (share < SOFT_SHARE).then_some(share)
}

/// Motor torque p D/(2 π) \[N m\] that holds a pressure difference p \[Pa\] across the pump, without losses. D is the
/// crane file's pump displacement \[m³/rev\].
pub fn holding_torque(description: &Description, pressure: f64) -> f64 {
    pressure * description.numbers.displacement / std::f64::consts::TAU
}

/// Remarks on a crane at rest: a load beyond the motor's torque, and soft oil at the pressure of the load.
///
/// `pressures` has pairs of a piston position \[m\] and the gauge pressure on the piston side there \[Pa\]. Each
/// remark is a sentence; there are none if nothing is remarkable.
pub fn rest_remarks(description: &Description, pressures: &[(f64, f64)]) -> Vec<String> {
    let n = &description.numbers;
    let soft: Vec<String> = pressures
        .iter()
        .filter_map(|(stroke, pressure)| {
            let share = bulk_modulus_share(description, *pressure)?;
            Some(format!(
                "{:.0} % at {:.0} mm ({:.1} bar)",
                share * 100.0,
                stroke * 1e3,
                pressure * 1e-5
            ))
        })
        .collect();
    let heaviest = largest(pressures);
    let torque = holding_torque(description, heaviest);
    let mut remarks = Vec::new();
    if torque > n.drive_torque {
        remarks.push(format!(
            "the motor does not lift the load: {:.1} bar at rest take {torque:.1} N m, and drive.max_torque_nm = {:.1}",
            heaviest * 1e-5,
            n.drive_torque
        ));
    }
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

/// Largest of the gauge pressures \[Pa\] over the stroke, zero at least. `pressures` has pairs of piston position
/// \[m\] and pressure \[Pa\].
pub fn largest(pressures: &[(f64, f64)]) -> f64 {
    pressures.iter().map(|(_, pressure)| *pressure).fold(0.0, f64::max)
}
