//! Surrogate plant: the virtual crane with all equipment but the drive switched off.

use hydroboom_description::Description;

/// The surrogate plant of a description: ideal sensors and valve, constant oil temperature, no dissolved air, one
/// implicit step a control period. The drive stays. Its dead time includes the fieldbus delay (the typical one if the
/// crane file has none), so that the surrogate's readings have the machine's timing.
///
/// The explicit scheme chatters at the load-holding valves where the oil is soft, and loses up to 0.7 % of the pumped
/// volume by it; the implicit scheme does not.
pub fn surrogate(model: &Description) -> Description {
    let mut machine = model.without_equipment();
    let (n, of) = (&mut machine.numbers, &model.numbers);
    n.drive_bandwidth = of.drive_bandwidth;
    n.drive_damping = of.drive_damping;
    n.drive_dead_time = of.drive_dead_time + fieldbus_delay(model);
    n.virtual_step = of.control_period;
    n.ripple = 0.0;
    n.air_shift = 0.0;
    n.oil_temperature = n.reference_temperature;
    n.heat_capacity = 0.0;
    machine
}

/// Sum of the fieldbus delays of command and measurement \[s\]; the typical one if the crane file has none.
pub fn fieldbus_delay(model: &Description) -> f64 {
    let n = model.virtual_crane().0.numbers;
    2.0 * n.fieldbus_delay.round() * n.control_period
}
