//! The model in a machine's place: the virtual crane with its equipment off, but for the drive.

use hydroboom_description::Description;

/// A model as a machine of its own: ideal sensors and valve, constant temperature and air, one implicit step a control period. The drive stays,
/// with all the delay from command to reading in its dead time, that of the fieldbus too (the typical one where the crane file has none): what is read of it is then
/// what is read of the machine, at the same time.
///
/// The published scheme chatters at the load-holding valves and loses oil by it where that is soft, up to 0.7 % of what is pumped: implicit steps do
/// not.
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

/// Delay of commands and readings by the fieldbus, together \[s\]: the typical one where the crane file has none.
pub fn fieldbus_delay(model: &Description) -> f64 {
    let n = model.virtual_crane().0.numbers;
    2.0 * n.fieldbus_delay.round() * n.control_period
}
