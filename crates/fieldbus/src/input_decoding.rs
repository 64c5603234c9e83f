//! Decoding of the inputs of all devices into a measurement, by the table of signals.

use crate::table::{Invalid, MEASURED, Table};
use hydroboom_control::measurement::{AXES, AxisMeasurement, AxisSignals, Measurement, Validity};
use hydroboom_control::supervision::limits::ValveState;

/// Signals of an axis; the measured signal after them is the valve's position switch.
const SIGNALS: usize = MEASURED.len() - 1;

/// Measurement of a number and a sampling time \[s\] from the inputs of each device, and the state of the load-holding
/// valve; none where its position switch is invalid or not in the table. A signal that is not in the table is absent.
pub(crate) fn decode(
    table: &Table,
    inputs: &[Vec<u8>],
    number: u64,
    time: f64,
) -> (Measurement, Option<ValveState>) {
    let mut signals = [[f64::NAN; SIGNALS]; AXES];
    let mut validity = [[Validity::Absent; SIGNALS]; AXES];
    let mut valve = None;
    for row in &table.measured {
        let Some(inputs) = inputs.get(row.place.device) else { continue };
        let value = row.scale.value(row.scale.kind.number(row.place.read(inputs)));
        let set = row.invalid.iter().filter(|(bits, _)| bits.is_set(inputs)).map(|(_, what)| what);
        let ranged = if row.scale.has(value) { Validity::Good } else { Validity::OutOfRange };
        let reported = set.fold(ranged, |before, what| match (before, what) {
            (Validity::Absent, _) | (_, Invalid::Absent) => Validity::Absent,
            (_, Invalid::OutOfRange) => Validity::OutOfRange,
        });
        if row.signal == SIGNALS {
            let state = if value > 0.5 { ValveState::Open } else { ValveState::Shut };
            valve = (reported == Validity::Good).then_some(state);
        } else if let (Some(signals), Some(validity)) =
            (signals.get_mut(row.axis), validity.get_mut(row.axis))
        {
            signals[row.signal] = value;
            validity[row.signal] = reported;
        }
    }
    let axis = |k: usize| AxisMeasurement {
        signals: AxisSignals::from_array(signals[k]),
        validity: AxisSignals::from_array(validity[k]),
    };
    (Measurement { number, time, axes: std::array::from_fn(axis) }, valve)
}
